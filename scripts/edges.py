# SPDX-License-Identifier: Apache-2.0
"""Draws doc/edges.svg from a rehearsed run: what the messages of a polled switch leave open."""

from pathlib import Path

from homing_node.figures.palette import BLUE, GREEN, INK, VERMILLION
from homing_node.parameters.axis import axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Input
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.run import Rehearsal

PICTURE = Path(__file__).resolve().parent.parent / 'doc' / 'edges.svg'
EDGE = 0.1  # m
SPEED = 0.05  # m/s
POLL_RATE = 10.0  # Hz
WIDTH, HEIGHT = 720, 330
LEFT, RIGHT, TOP, BOTTOM = 70, 20, 30, 90


class Recorded(Rehearsal):
    """A rehearsal that remembers what arrives: the levels and the feedback."""

    def _introduce(self) -> None:
        self.levels: list[tuple[float, bool]] = []
        self.feedback: list[tuple[float, float]] = []
        switch, feedback = self.axis.switch, self.axis.feedback

        def take_switch(source: Input, time: float, level: bool, *more: float) -> None:
            self.levels.append((time, level))
            switch(source, time, level, *more)

        def take_feedback(time: float, position: float, *more: float) -> None:
            self.feedback.append((time, position))
            feedback(time, position, *more)

        self.axis.switch = take_switch  # type: ignore[method-assign]
        self.axis.feedback = take_feedback  # type: ignore[method-assign]
        super()._introduce()


def recorded() -> Recorded:
    """Home onto a polled switch."""
    parameters = axis_parameters(
        {
            'home_type': 'HS',
            'travel': 0.3,
            'homing_velocity_fast': SPEED,
            'switches': ['home_switch'],
        }
    )
    layout = AxisLayout(
        (0.0, 0.3), {'home_switch': SwitchLayout(EDGE, EDGE + 0.05)}, start=EDGE - 0.03
    )
    run = Recorded(parameters, layout, Transport(poll_rate=POLL_RATE, feedback_rate=100.0, seed=3))
    run.home()
    return run


def svg(run: Recorded) -> str:
    """Return the figure."""
    outcome = run.course.outcome
    assert outcome is not None and outcome.success
    first = next(i for i, (_, level) in enumerate(run.levels) if level)
    (begin, _), (end, _) = run.levels[first - 1], run.levels[first]
    low_time, high_time = begin - 0.12, end + 0.14
    home, unsure = outcome.home_position_raw, outcome.uncertainty
    low, high = home - 0.0085, home + 0.0085

    def x(time: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (time - low_time) / (high_time - low_time)

    def y(position: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - position) / (high - low)

    right, floor = WIDTH - RIGHT, HEIGHT - BOTTOM
    line = ' '.join(f'{x(t):.1f},{y(p):.1f}' for t, p in run.feedback if low_time < t < high_time)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'font-family="sans-serif" font-size="13" fill="{INK}">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<rect x="{x(begin):.1f}" y="{TOP}" width="{x(end) - x(begin):.1f}" '
        f'height="{floor - TOP}" fill="{GREEN}" opacity="0.15"/>',
        f'<rect x="{LEFT}" y="{y(home + unsure):.1f}" width="{right - LEFT}" '
        f'height="{y(home - unsure) - y(home + unsure):.1f}" fill="{BLUE}" opacity="0.15"/>',
        f'<path d="M{LEFT},{y(home):.1f}H{right}" stroke="{BLUE}" stroke-width="2"/>',
        f'<path d="M{LEFT},{y(EDGE):.1f}H{right}" stroke="{VERMILLION}" stroke-dasharray="5 4"/>',
        f'<polyline points="{line}" fill="none" stroke="{INK}" stroke-width="1.5"/>',
        f'<path d="M{LEFT},{TOP}V{floor}H{right}" fill="none" stroke="{INK}"/>',
        f'<text x="{LEFT + 8}" y="{y(home) - 6:.1f}" fill="{BLUE}">home, ± uncertainty</text>',
        f'<text x="{right - 8}" y="{y(EDGE) - 6:.1f}" fill="{VERMILLION}" '
        f'text-anchor="end">true edge</text>',
        f'<text x="{0.5 * (x(begin) + x(end)):.1f}" y="{TOP - 10}" text-anchor="middle">'
        f'the messages leave {1e3 * (end - begin):.0f} ms open</text>',
        f'<text x="{LEFT - 12}" y="{TOP + 100}" text-anchor="middle" '
        f'transform="rotate(-90 {LEFT - 12} {TOP + 100})">feedback</text>',
        f'<text x="{LEFT}" y="{HEIGHT - 12}">messages of the home switch, '
        f'{POLL_RATE:g} times a second; time →</text>',
    ]
    for time, level in run.levels:
        if low_time < time < high_time:
            fill = VERMILLION if level else 'white'
            parts.append(
                f'<circle cx="{x(time):.1f}" cy="{floor + 30}" r="6" fill="{fill}" '
                f'stroke="{INK}"/><text x="{x(time) + 11:.1f}" y="{floor + 35}">'
                f'{"on" if level else "off"}</text>'
            )
    return '\n'.join([*parts, '</svg>', ''])


def main() -> None:
    """Draw the figure."""
    PICTURE.write_text(svg(recorded()))


if __name__ == '__main__':
    main()
