"""python -m abs_hil.optimum: the bound of one plant and road, or the table of docs/benchmark.md."""
import argparse
import json
import sys
from collections.abc import Sequence

from ..options import failed, settings_of


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog='python -m abs_hil.optimum', allow_abbrev=False,
                                     description='The shortest braking of a simulated rig, by optimal control.')
    parser.add_argument('--plant', metavar='NAME|FILE', default='paper-table1')
    parser.add_argument('--set', metavar='KEY=VALUE', action='append', default=[], help='a configuration value; may be repeated')
    parser.add_argument('--start-speed', metavar='RAD_S', type=float, default=170.0, help='both wheels\' (170 rad/s)')
    parser.add_argument('--end-speed', metavar='M_S', type=float, default=0.3, help='the car\'s, where braking ends (0.3 m/s)')
    parser.add_argument('--json', action='store_true', help='prints JSON')
    given = parser.parse_args(arguments)
    try:
        from . import NoOptimum, drive, optimum
    except ImportError as error:
        return failed('abs_hil.optimum', error, 3)
    try:
        values, found = settings_of(given.set), {}
        for name, knows_road in (('causal', False), ('preview', True)):
            braking = optimum(given.plant, values, start_speed_rad_s=given.start_speed, end_speed_m_s=given.end_speed,
                              knows_road=knows_road)
            driven = drive(braking, given.plant, values)
            found[name] = {'distance_m': braking.distance_m, 'time_s': braking.stop_time_s,
                           'torque_variation_Nm': braking.variation_Nm, 'distance_on_plant_m': driven.distance_m}
    except (ValueError, NoOptimum) as error:
        return failed('abs_hil.optimum', error)
    if given.json:
        print(json.dumps(found, indent=2))
        return 0
    for name, row in found.items():
        print(f'{name:<8} {row["distance_m"]:.3f} m in {row["time_s"]:.3f} s, torque variation '
              f'{row["torque_variation_Nm"]:.1f} N m; the plant takes {row["distance_on_plant_m"]:.3f} m')
    return 0


if __name__ == '__main__':
    sys.exit(main())
