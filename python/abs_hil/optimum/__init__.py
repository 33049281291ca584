"""How short a braking can be: optimal control of the rig's own equations (docs/benchmark.md). Needs casadi."""
from collections.abc import Mapping

from ..options import PathLike, Value
from .drivers import Driven, causal, drive, preview
from .rig import Rig, road_of
from .trajectory import NoOptimum, Trajectory

__all__ = ['Driven', 'END_SPEED_M_S', 'NoOptimum', 'Rig', 'START_SPEED_RAD_S', 'Trajectory', 'drive', 'optimum']

START_SPEED_RAD_S = 170.0
#: car speed at which slip control ends by default
END_SPEED_M_S = 0.3


def optimum(plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None, *,
            start_speed_rad_s: float = START_SPEED_RAD_S, end_speed_m_s: float = END_SPEED_M_S,
            knows_road: bool = False, upper_speed_rad_s: float | None = None,
            known: Trajectory | None = None) -> Trajectory:
    """The shortest braking of a plant of ours, with its lag, the limit of its torque and that of the torque's rate.

    plant, set: as in abs_hil.simulate; the road is `plant.friction_profile`, with braking from its start on.
    start_speed_rad_s: of both wheels, or of the lower one if upper_speed_rad_s says how fast the other one turns. Equal speeds
    are traction where the radii differ; wheels that have coasted begin with a slip of nearly 0.
    end_speed_m_s: of the car, where the distance ends.
    knows_road: False: knows the tyre and the present friction and takes it to last (causal). True: knows the whole road.
    known: with knows_road, a braking on the same road that has been found already.

    Dead time, hysteresis and fading of the brake are left out, and that friction falls with the sliding speed. All can only
    lengthen the distance: a bound it stays.
    Raises ValueError for speeds outside (0, 1000] rad/s and below the start speed, NoOptimum if the solver fails.
    """
    rig = Rig.of(plant=plant, set=set)
    if not 0.0 < start_speed_rad_s <= 1000.0:
        raise ValueError(f'start_speed_rad_s {start_speed_rad_s:g}: give a speed in (0, 1000] rad/s')
    if not 0.05 <= end_speed_m_s < 0.9 * rig['r2_m'] * start_speed_rad_s:
        raise ValueError(f'end_speed_m_s {end_speed_m_s:g}: give a speed in [0.05, {0.9 * rig["r2_m"] * start_speed_rad_s:.3g}) '
                         'm/s, below nine tenths of the start speed')
    start = rig.state(start_speed_rad_s if upper_speed_rad_s is None else upper_speed_rad_s, start_speed_rad_s)
    if knows_road:
        return preview(rig, start, road_of(rig), end_speed_m_s, known)
    return causal(rig, start, road_of(rig), end_speed_m_s)
