"""abs_convert: runs as files for other tools; `abs_hil convert` starts it."""
import errno
import pathlib
import signal
from typing import Any

from .. import parsers
from ..files import write_whole
from ..options import failed
from ..recording import named

TARGETS = ('.csv', '.mcap', '.parquet')
#: reasons for which a file cannot be written that are not the command's fault
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def main(arguments: list[str]) -> int:
    given = parsers.convert().parse_args(arguments)
    *inputs, out = [*given.files, *filter(None, [given.out])] or ['']
    output = pathlib.Path(out)
    try:
        if output.suffix not in TARGETS:
            raise ValueError(f'OUT = {out or "nothing"}: give a name that ends in .csv, .mcap or .parquet')
        if len(inputs) != (given.live is None):
            raise ValueError('give one IN, or --live URL in its place')
        if not output.parent.is_dir():
            raise ValueError(f'OUT = {output}: there is no folder {output.parent}; create it first')
        if given.live is None and (given.idle is not None or given.seconds is not None):
            raise ValueError('--idle and --seconds belong to --live')
        if given.live is not None and output.suffix != '.mcap':
            raise ValueError('--live writes .mcap only; convert that run\'s folder or log to .parquet afterwards')
        print(_record(given, output) if given.live is not None else _convert(inputs[0], output))
        return 0
    except (ValueError, OSError) as error:
        full = isinstance(error.__context__, OSError) and error.__context__.errno in FULL
        return failed('abs_convert', error, 1 if full else 3 if isinstance(error, OSError) else 2)


def _convert(path: str, output: pathlib.Path) -> str:
    from . import recorded
    origin = named(path)[0].resolve()
    if output.resolve() == origin or origin.is_dir() and output.resolve().parent == origin:
        raise ValueError(f'OUT = {output}: this command reads it; give another file')
    read, more = recorded.read(path), ''
    if output.suffix == '.csv':
        more = recorded.to_csv(read, path, output)
    else:
        write = recorded.to_mcap if output.suffix == '.mcap' else recorded.to_parquet
        write_whole(output, lambda name: write(read, name))
    return f'{len(read)} rows, {len(read.events)} events{more}; lost: {"; ".join(read.losses) or "nothing"}'


def _record(given: Any, output: pathlib.Path) -> str:
    from . import running
    from .messages import McapFile
    # A request to end must not cut the file short.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    result = ''

    def record(name: str) -> None:
        nonlocal result
        with open(name, 'wb') as file:
            recorder = running.Recorder(McapFile(file, library='abs_hil'))
            try:
                for channel, message in running.received(given.live, given.prefix, given.idle, given.seconds):
                    recorder.take(channel, message)
            except KeyboardInterrupt:
                pass
            recorder.finish()
            if recorder.rows == 0:
                raise ValueError(f'no telemetry of abs_hil came on {given.live or "the default network"}; `abs_hil doctor --only '
                                 'lcm` says whether this computer can receive it')
        result = (f'{recorder.rows} rows; lost: {recorder.lost} messages on the way, {recorder.damaged} damaged')

    write_whole(output, record)
    return result
