"""The optima of the benchmark's cases: stored with the package, or computed (research/benchmark_bounds.py)."""
import hashlib
import json
import pathlib
from collections.abc import Iterable

from ..files import parse_json, read_text, write_text
from ..options import Value
from ..stepped import Plant
from .cases import COAST_S, END_SPEED_M_S, VERSION, Case

#: what the bound leaves out, which can only shorten the distance
_IGNORED = ('brake_dead_time_s', 'brake_hysteresis', 'encoder_')
STORED = pathlib.Path(__file__).with_name('bounds-2.json')


def values_of(case: Case) -> dict[str, Value]:
    """What a case's bound depends on, besides plant and speeds."""
    return {name: value for name, value in case.plant_values().items() if not any(part in name for part in _IGNORED)}


def identity(case: Case) -> str:
    """Of everything that a case's bound depends on: cases with the same physics share one."""
    text = json.dumps([case.plant, case.start_speed_rad_s, END_SPEED_M_S, sorted(values_of(case).items())])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def coasted(case: Case) -> tuple[float, float, float]:
    """The speed of both wheels from which they coast down to the case's speed, and the speeds of the upper and of the lower
    wheel at the start of braking, rad/s."""
    plant = Plant(case.plant, case.plant_values())
    speed = case.start_speed_rad_s
    for _ in range(8):
        begun = speed
        plant.reset(omega1_rad_s=speed, omega2_rad_s=speed)
        plant.advance(COAST_S)
        speed += case.start_speed_rad_s - plant.state.omega2_rad_s
    return begun, float(plant.state.omega1_rad_s), float(plant.state.omega2_rad_s)


def stored(path: pathlib.Path | None = None) -> dict[str, dict[str, float]]:
    """identity -> distance_m, time_s, torque_variation_Nm and distance_on_plant_m of the causal optimum, least_distance_m of one
    who knows the whole road. Raises ValueError for a file that is none, that another version wrote, or that somebody has
    changed."""
    path = path or STORED
    try:
        content = parse_json(read_text(path))
        version, found, kept = content['version'], dict(content['bounds']), content.get('checksum')
    except (OSError, KeyError, TypeError, ValueError):
        raise ValueError(f'{path}: no file of bounds; give one that --bounds has written, or a new name') from None
    if version != VERSION:
        raise ValueError(f'{path}: bounds of version {version} of the benchmark, this is version {VERSION}; give a new name')
    if kept != checksum(found):
        raise ValueError(f'{path}: the bounds do not fit their checksum, so somebody has changed them; compute them again')
    return found


def text_of(bounds: dict[str, dict[str, float]]) -> str:
    return json.dumps({'version': VERSION, 'checksum': checksum(bounds), 'bounds': bounds}, indent=1) + '\n'


def checksum(bounds: dict[str, dict[str, float]]) -> str:
    return hashlib.sha256(json.dumps(bounds, sort_keys=True).encode()).hexdigest()


def compute(case: Case) -> dict[str, float]:
    """The causal optimum of a case, and the distance of one who knows the whole road. Needs casadi."""
    from ..optimum import Trajectory, drive, optimum
    values = values_of(case)
    _, upper_rad_s, lower_rad_s = coasted(case)

    def best(knows_road: bool, known: Trajectory | None = None) -> Trajectory:
        return optimum(case.plant, values, start_speed_rad_s=lower_rad_s, upper_speed_rad_s=upper_rad_s,
                       end_speed_m_s=END_SPEED_M_S, knows_road=knows_road, known=known)
    causal = best(False)
    # With a known road a solver may end in a worse local optimum than the causal braking is.
    least_m = min(causal.distance_m, best(True, causal).distance_m) if case.profile else causal.distance_m
    on_plant = drive(causal, case.plant, values)
    return {'distance_m': round(causal.distance_m, 5), 'time_s': round(causal.stop_time_s, 5),
            'torque_variation_Nm': round(causal.variation_Nm, 2), 'distance_on_plant_m': round(on_plant.distance_m, 5),
            'least_distance_m': round(least_m, 5)}


def found(cases: Iterable[Case], kept: pathlib.Path | None = None) -> dict[str, dict[str, float]]:
    """The bounds of all cases that have one: stored ones, those in the file `kept`, and others computed (needs casadi).

    A case for which the solver finds none has an empty one. What is computed goes into `kept` at once, so that an interrupted
    computation goes on where it was. Raises ValueError for a file that holds something else.
    """
    own = stored(kept) if kept is not None and kept.exists() else {}
    known = stored() | own
    for case in missing(cases, known):
        from ..optimum import NoOptimum
        try:
            own[identity(case)] = compute(case)
        except NoOptimum:
            own[identity(case)] = {}
        if kept is not None:
            write_text(kept, text_of(own))
    return known | own


def missing(cases: Iterable[Case], known: dict[str, dict[str, float]]) -> list[Case]:
    """The first case of each identity that has no bound."""
    found: dict[str, Case] = {}
    for case in cases:
        if identity(case) not in known:
            found.setdefault(identity(case), case)
    return list(found.values())
