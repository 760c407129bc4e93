# SPDX-License-Identifier: Apache-2.0
"""Makes the figures of doc/gantry.md: runs of config/gantry.yaml on its simulated machine."""

from pathlib import Path

from docs import small_svg

from homing_node.figures.plot import POSITION_DIAGRAM, figure
from homing_node.parameters.yaml_file import load
from homing_node.plant import layout_file
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.sweep import Trial, rehearse_from

ROOT = Path(__file__).resolve().parent.parent
CONFIG, FIGURES = ROOT / 'config', ROOT / 'doc' / 'figures'
#: How much later the follower obeys in the run that fails, s.
LATE = 0.06


def run(delay: float = 0.0) -> tuple[Trial, str]:
    """Rehearse the gantry, with a follower that obeys late; return the run and its drawing."""
    configuration = load(CONFIG / 'gantry.yaml')
    layout = layout_file.load(CONFIG / 'simulated_gantry.yaml').layouts['y']
    late = {name: one._replace(delay=delay) for name, one in layout.followers.items()}
    layout = layout._replace(followers=late)
    followers = configuration.followers['y']
    trial = rehearse_from(configuration.axes['y'], layout, Transport(), None, 'y', followers)
    ended = 'homes square' if trial.success else f'{trial.error}, y2 obeys {delay:g} s late'
    return trial, small_svg(figure(trial.course, layout, f'HSHS: {ended}', POSITION_DIAGRAM))


def main() -> None:
    for name, delay in (('square', 0.0), ('skew', LATE)):
        trial, drawn = run(delay)
        (FIGURES / f'gantry_{name}.svg').write_text(drawn)
        course = trial.course
        print(
            f'gantry_{name}: {trial.error or "homed"}, {course.duration:.2f} s, skewed by up to '
            f'{1e3 * course.largest_skew:.3f} mm, {course.largest_force:.0f} N, at the end '
            f'{course.followers["y.y2"].forces[-1]:.1f} N'
        )


if __name__ == '__main__':
    main()
