#!/usr/bin/env python3
"""usage: rig_figure.py [--check | --to FILE]

Writes docs/figures/rig.svg: the rig, its signals and the program, as README.md shows them. The picture takes its colours
from the reader's theme, light or dark. With --check it writes nothing and ends with status 1 if the stored file differs.
--to writes FILE instead.
"""
import math
import pathlib
import sys
from xml.sax.saxutils import escape

STYLE = """
  svg { --ink: #1f2328; --soft: #59636e; --ground: #ffffff; --road: #dfe5ec; --tyre: #c9d3de; --box: #f3f5f8;
        --measured: #0a5fb4; --commanded: #b3400e; }
  @media (prefers-color-scheme: dark) {
    svg { --ink: #e6edf3; --soft: #9aa5b1; --ground: #0d1117; --road: #2b333d; --tyre: #3a4552; --box: #171d25;
          --measured: #6cb6ff; --commanded: #ff9b66; }
  }
  text { font: 15px system-ui, 'Liberation Sans', Arial, sans-serif; fill: var(--ink); }
  .soft { fill: var(--soft); font-size: 13px; }  .head { font-weight: 600; }
  .ground { fill: var(--ground); }  .road { fill: var(--road); }  .tyre { fill: var(--tyre); }  .box { fill: var(--box); }
  .line { stroke: var(--ink); stroke-width: 1.6; }  .none { fill: none; }  .solid { fill: var(--ink); }
  .frame { stroke: var(--soft); stroke-width: 1.2; stroke-dasharray: 6 5; fill: none; }
  .measured { stroke: var(--measured); stroke-width: 2.2; fill: none; }  text.measured { stroke: none; fill: var(--measured); }
  .commanded { stroke: var(--commanded); stroke-width: 2.2; fill: none; }
  text.commanded { stroke: none; fill: var(--commanded); }
  .headmeasured { fill: var(--measured); }  .headcommanded { fill: var(--commanded); }  .headline { fill: var(--ink); }
"""
UPPER, LOWER, RADIUS = (210, 146), (210, 302), 78  # px: centres of the wheels, which touch, and their radius
BOARD_X, COMPUTER_X = 470, 640


def text(x, y, words, kind='', anchor='start'):
    return f'<text x="{x}" y="{y}" class="{kind}" text-anchor="{anchor}">{escape(words)}</text>'


def box(x, y, width, height, kind='box line'):
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" class="{kind}"/>'


def circle(centre, radius, kind):
    return f'<circle cx="{centre[0]}" cy="{centre[1]}" r="{radius}" class="{kind}"/>'


def arrow(points, kind):
    """A line through the points with a head at its last one."""
    (x0, y0), (x1, y1) = points[-2:]
    angle = math.atan2(y1 - y0, x1 - x0)
    corners = [(x1, y1)] + [(x1 - 10 * math.cos(angle + turn), y1 - 10 * math.sin(angle + turn)) for turn in (-0.42, 0.42)]
    head = ' '.join(f'{x:.1f},{y:.1f}' for x, y in corners)
    line = ' '.join(f'{x},{y}' for x, y in points[:-1]) + f' {x1 - 7 * math.cos(angle):.1f},{y1 - 7 * math.sin(angle):.1f}'
    return f'<polyline points="{line}" class="{kind} none"/><polygon points="{head}" class="head{kind}"/>'


def turning(centre, clockwise):
    """An arc with a head inside a wheel: the way in which it turns."""
    radius, ends = 60, (math.radians(200), math.radians(250))
    if not clockwise:
        ends = (math.radians(160), math.radians(110))
    places = [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in ends]
    (x0, y0), (x1, y1) = places
    sweep = 1 if clockwise else 0
    along = ends[1] + (math.pi / 2 if clockwise else -math.pi / 2)
    corners = [(x1 + 8 * math.cos(along), y1 + 8 * math.sin(along))]
    corners += [(x1 + 6 * math.cos(along + turn), y1 + 6 * math.sin(along + turn)) for turn in (2.2, -2.2)]
    head = ' '.join(f'{x:.1f},{y:.1f}' for x, y in corners)
    return (f'<path d="M {x0:.1f} {y0:.1f} A {radius} {radius} 0 0 {sweep} {x1:.1f} {y1:.1f}" class="line none"/>'
            f'<polygon points="{head}" class="headline"/>')


def rig():
    """Wheels, lever, brake, motor, encoders."""
    parts = ['<path d="M 40 396 H 390" class="line"/>',
             # Lever: it presses the upper wheel on the lower one.
             f'<path d="M 40 146 H {UPPER[0]}" stroke-width="7" class="line" style="stroke-width:7"/>',
             '<path d="M 40 146 L 56 396" class="line"/>', circle((40, 146), 6, 'ground line'),
             arrow([(105, 92), (105, 138)], 'line'), text(105, 82, 'lever and load', 'soft', 'middle'),
             circle(UPPER, RADIUS, 'tyre line'), circle(LOWER, RADIUS, 'road line'),
             # Disc and caliper.
             circle(UPPER, 36, 'box line'), box(UPPER[0] + 22, UPPER[1] + 2, 22, 28, 'solid'),
             turning(UPPER, True), turning(LOWER, False),
             circle(UPPER, 5, 'solid'), circle(LOWER, 5, 'solid'),
             # Motor and belt.
             circle((84, 345), 24, 'box line'), text(84, 350, 'M', 'head', 'middle'),
             f'<path d="M 77 322 L {LOWER[0] - 3} {LOWER[1] - 14} M 90 368 L {LOWER[0] + 5} {LOWER[1] + 13}" class="line"/>',
             circle(LOWER, 14, 'none line'),
             text(210, 40, 'upper wheel: the car’s wheel', 'head', 'middle'),
             text(210, 58, 'plastic, with a disc brake', 'soft', 'middle'),
             text(210, 420, 'lower wheel: the road and the car’s mass', 'head', 'middle'),
             text(210, 438, 'aluminium, driven by a DC motor', 'soft', 'middle'),
             text(UPPER[0] - 2, UPPER[1] + 62, 'ω₁, r₁', '', 'middle'), text(LOWER[0] + 2, LOWER[1] - 48, 'ω₂, r₂', '', 'middle')]
    return parts


def signals():
    """The four signals between rig and board."""
    left, right = UPPER[0], BOARD_X
    return [arrow([(left, 146), (left + 112, 96), (right, 96)], 'measured'),
            text(right - 8, 88, 'upper encoder: counts', 'measured', 'end'),
            arrow([(right, 162), (UPPER[0] + 46, 162)], 'commanded'),
            text(right - 8, 154, 'brake PWM', 'commanded', 'end'),
            arrow([(left, 302), (left + 112, 262), (right, 262)], 'measured'),
            text(right - 8, 254, 'lower encoder: counts', 'measured', 'end'),
            arrow([(right, 382), (84, 382), (84, 371)], 'commanded'),
            text(right - 8, 374, 'motor PWM', 'commanded', 'end')]


def program():
    """Board and computer: the path of one cycle."""
    x, wide = COMPUTER_X, 236
    rows = [(52, 'estimate', 'counts → ω₁, ω₂, slip λ'), (126, 'experiment', 'accelerate, coast, brake, stop'),
            (200, 'controller', 'λ → brake torque → duty'), (274, 'gate', 'checks, limits, latches faults')]
    parts = [box(BOARD_X, 70, 104, 326), text(BOARD_X + 52, 210, 'I/O board', 'head', 'middle'),
             text(BOARD_X + 52, 230, 'PCI, USB,', 'soft', 'middle'), text(BOARD_X + 52, 247, 'CAN, Ethernet', 'soft', 'middle'),
             text(x + wide / 2, 36, 'abs_hil: 1000 times a second', 'head', 'middle')]
    for y, name, what in rows:
        parts += [box(x, y, wide, 50), text(x + 12, y + 21, name, 'head'), text(x + 12, y + 40, what, 'soft')]
        if name != 'gate':
            parts.append(arrow([(x + wide / 2, y + 50), (x + wide / 2, y + 74)], 'line'))
    parts += [arrow([(BOARD_X + 104, 78), (x, 78)], 'measured'), arrow([(x, 299), (BOARD_X + 104, 299)], 'commanded'),
              box(x, 346, wide, 50), text(x + 12, 367, 'guardian', 'head'),
              text(x + 12, 386, 'zeroes the outputs if abs_hil dies', 'soft'),
              arrow([(x, 371), (BOARD_X + 104, 371)], 'commanded'),
              text(x + wide / 2, 438, 'out: CSV, log, LCM, report', 'soft', 'middle'),
              arrow([(x + wide, 225), (x + wide + 24, 225), (x + wide + 24, 433), (x + wide - 26, 433)], 'line'),
              box(16, 14, BOARD_X + 104, 466, 'frame'),
              text(26, 470, 'the real rig (--backend rig), or its simulation (--backend sim)', 'soft'),
              text(x + wide / 2, 470, 'λ = (r₂ω₂ − r₁ω₁) / (r₂ω₂)', '', 'middle')]
    return parts


def picture():
    about = ('Two wheels of equal size, one above the other. The lower one, driven by a motor, stands for the road; the upper '
             'one, with a disc brake, for the wheel of the car. Both encoders give counts to an I/O board, which gives PWM to '
             'brake and motor. The program estimates speeds and slip, chooses the phase, computes the brake duty and checks it.')
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 920 496" role="img" aria-labelledby="title about">',
             '<title id="title">The rig and its signals</title>', f'<desc id="about">{escape(about)}</desc>',
             f'<style>{STYLE}</style>', '<rect width="920" height="496" class="ground"/>',
             *rig(), *signals(), *program(), '</svg>']
    return '\n'.join(parts) + '\n'


def main():
    target = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'figures' / 'rig.svg'
    if sys.argv[1:] == ['--check']:
        if target.read_text(encoding='utf-8') != picture():
            print(f'{target} differs from what {__file__} draws: run it', file=sys.stderr)
            return 1
        return 0
    if sys.argv[1:2] == ['--to'] and len(sys.argv) == 3:
        target = pathlib.Path(sys.argv[2])
    elif sys.argv[1:]:
        print(__doc__, file=sys.stderr)
        return 2
    target.write_text(picture(), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
