"""LCM's own tools and its Python module on what we publish and log: a run in real time is recorded by lcm-logger, seen
live by a Python subscriber and replayed by lcm-logplayer; each decoded value equals the CSV's to the last bit. The Python
examples of docs/telemetry.md do what they say. In a network namespace of its own.

usage: interop_test.py PROGRAM PRIVATE_NETWORK_SCRIPT PYTHON_MODULE_DIR LCM_PYTHON TELEMETRY_PAGE
Status 77, with the reason, where LCM's Python module or a namespace cannot be had.
"""
import csv
import math
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time

from live import PATIENT

URL = 'udpm://239.255.76.67:7667?ttl=0'
CHANNELS = {'ABS_TELEMETRY': 'telemetry_t', 'ABS_STATUS': 'status_t', 'ABS_EVENT': 'event_t',
            'ABS_EXPERIMENT': 'experiment_t'}


def urgent():
    """Gives lcm-logger and subscribers priority where permitted, because they drop what they cannot read in time."""
    permitted = subprocess.run(['chrt', '-f', '10', 'true'], stderr=subprocess.DEVNULL).returncode == 0
    return ['chrt', '-f', '10'] if permitted else []


def wait_for_listeners(count):
    """Waits until that many sockets in this namespace listen on LCM's port 7667 = 0x1DF3, and until LCM has
    entered its handlers."""
    for _ in range(400):
        if pathlib.Path('/proc/net/udp').read_text().count(':1DF3 ') >= count:
            time.sleep(0.3)
            return
        time.sleep(0.05)
    raise AssertionError(f'no {count} LCM listeners within 20 s')


class Subscriber:
    """Receives all telemetry messages through LCM's Python module while it is open."""

    def __init__(self, expected):
        self.packets = []
        self._expected = expected
        self._network = lcm.LCM(URL)
        self._network.subscribe('ABS_TELEMETRY', lambda _, data: self.packets.append(data)).set_queue_capacity(100_000)
        self._thread = threading.Thread(target=self._listen)
        self._end = False
        self._thread.start()

    def _listen(self):
        while not self._end:
            self._network.handle_timeout(100)

    def finish(self):
        for _ in range(50):
            if self._expected and len(self.packets) >= self._expected:
                break
            time.sleep(0.02)
        self._end = True
        self._thread.join()
        return [abs_hil.decode(packet) for packet in self.packets]


def bits(value):
    """Bits of a double; all NaN are equal."""
    return 'NaN' if math.isnan(value) else struct.pack('>d', value).hex()


def compare(name, messages, rows):
    """Compares every row of the CSV with the message of its cycle: every column, bit by bit."""
    assert [m.cycle for m in messages] == list(range(len(rows))), f'{name}: {len(messages)} messages, {len(rows)} rows'
    values = 0
    for message, row in zip(messages, rows):
        for column, text in row.items():
            if not hasattr(message, column):  # the CSV got this column after the message type was published
                assert column not in CONTRACT, f'{name}: no field {column}'
                continue
            seen = getattr(message, column)
            if column == 'phase':
                assert abs_hil.PHASES[seen] == text, f'{name}, cycle {message.cycle}: phase {seen}, CSV {text}'
            else:
                assert bits(float(seen)) == bits(float(text)), f'{name}, cycle {message.cycle}: {column} {seen!r}, CSV {text}'
            values += 1
    print(f'{name}: {values} values of {len(rows)} cycles equal the CSV bit by bit')


CONTRACT = ('time_s,phase,omega1_rad_s,omega2_rad_s,omega1_est_rad_s,omega2_est_rad_s,slip,slip_est,slip_ref,brake_torque_Nm,'
            'brake_torque_ref_Nm,brake_torque_est_Nm,brake_pwm,motor_pwm,motor_enable,theta_N,theta_est_N,distance_m,'
            'slip_velocity_error_m_s').split(',')


def read_log(path):
    """Telemetry messages of an event log; every other message must be of its channel's type too."""
    telemetry = []
    for event in lcm.EventLog(str(path)):
        if event.channel == 'LCM_SELF_TEST':  # liblcm's own message, which lcm-logger also records
            continue
        message = abs_hil.decode(event.data)
        # Later channels may carry any type, as long as it is one of ours.
        assert type(message).__name__ == CHANNELS.get(event.channel, type(message).__name__), (event.channel, type(message))
        if event.channel == 'ABS_TELEMETRY':
            telemetry.append(message)
    return telemetry


def recorded_live_and_replayed(program, folder):
    logger = subprocess.Popen([*urgent(), 'lcm-logger', '-q', f'--lcm-url={URL}', f'{folder}/logger.lcmlog'])
    live = Subscriber(None)
    try:
        wait_for_listeners(2)
        run = subprocess.run([program, *PATIENT, '--set', 'experiment.start_speed_rad_s=120', '--csv', f'{folder}/run.csv',
                              '--log', f'{folder}/own.lcmlog'], capture_output=True, text=True, timeout=60)
    finally:
        seen = live.finish()
        logger.send_signal(signal.SIGINT)
        logger.wait(timeout=10)
    assert run.returncode == 0, run.stderr
    with open(f'{folder}/run.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert set(CONTRACT) <= set(rows[0]) and len(rows) > 1000
    compare('event log', read_log(f'{folder}/own.lcmlog'), rows)
    compare('lcm-logger', read_log(f'{folder}/logger.lcmlog'), rows)
    compare('live subscriber', seen, rows)

    replayed = Subscriber(len(rows))
    wait_for_listeners(1)
    subprocess.run(['lcm-logplayer', f'--lcm-url={URL}', f'{folder}/logger.lcmlog'], check=True, timeout=60,
                   stdout=subprocess.DEVNULL)
    compare('lcm-logplayer', replayed.finish(), rows)

    # The comparison itself must detect a single wrong bit.
    wrong = read_log(f'{folder}/own.lcmlog')
    wrong[500].slip_est = math.nextafter(wrong[500].slip_est, 2.0)
    try:
        compare('one bit wrong', wrong, rows)
    except AssertionError as error:
        assert 'slip_est' in str(error)
    else:
        raise AssertionError('one wrong bit was not seen')


def examples_of_the_page(program, module_dir, page, folder):
    blocks = dict(re.findall(r'^```python example=(\w+)\n(.*?)^```$', pathlib.Path(page).read_text(), re.M | re.S))
    assert set(blocks) == {'log', 'live'}, f'{page}: examples {sorted(blocks)}'
    # As the page says. Tests of the package try its installation.
    environment = {**os.environ, 'PYTHONPATH': module_dir}

    log = subprocess.run([sys.executable, '-c', blocks['log'], f'{folder}/own.lcmlog'], env=environment, check=True,
                         capture_output=True, text=True, timeout=60).stdout
    assert len(re.findall(r'^ *\d+\.\d+ s  slip +[-\d.]+  theta +[\d.]+ N$', log, re.M)) >= 5, log

    live = subprocess.Popen([sys.executable, '-c', blocks['live'], URL], env=environment, stdout=subprocess.PIPE, text=True)
    wait_for_listeners(1)
    subprocess.run([program, *PATIENT, '--set', 'experiment.start_speed_rad_s=120'], check=True, capture_output=True, timeout=60)
    text, _ = live.communicate(timeout=20)
    assert live.returncode == 0 and len(re.findall(r'^brake +slip [\d.]+  theta', text, re.M)) >= 1, text
    print('the examples of the page work')


def skip(reason):
    print(f'SKIPPED: {reason}')
    sys.exit(77)


def main():
    program, private_network, module_dir, lcm_python, page = sys.argv[1:6]
    if 'inside' not in sys.argv:
        probe = ['sh', '-c', 'exec "$0" -c "import lcm"', lcm_python]
        if subprocess.run(probe, capture_output=True).returncode != 0:
            skip(f"{lcm_python} with LCM's Python module is missing; scripts/setup_python.sh installs it")
        os.execv(private_network, [private_network, lcm_python, __file__, *sys.argv[1:6], 'inside'])
    sys.path.insert(0, module_dir)
    global lcm, abs_hil
    import lcm
    import abs_hil
    with tempfile.TemporaryDirectory() as folder:
        recorded_live_and_replayed(program, folder)
        examples_of_the_page(program, module_dir, page, folder)


if __name__ == '__main__':
    main()
