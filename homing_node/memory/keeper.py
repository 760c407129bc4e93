# SPDX-License-Identifier: Apache-2.0
"""The memory of one axis: it judges each run, and says what is to be written.

The cycle calls :meth:`Keeper.judge`, which only computes; another thread writes what
:meth:`Keeper.snapshot` returns. The caller guards both with its lock.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..core.axis import Axis
from ..core.kept_home import Ended, RunKind
from ..core.outcome import Outcome
from ..core.remembered import Remembered
from ..parameters.axis import AxisParameters
from ..procedures.states import Encoder, Error
from .comparison import Memory, rules_of
from .quantities import HOME, Seen, quantities_of
from .records import Rest, Run
from .restoring import Present, Refused, Restored, restored
from .store import Contents


class Snapshot(NamedTuple):
    """What is to be written of an axis."""

    rest: Rest
    runs: tuple[Run, ...]
    changed: int | None  # the number of a run that has changed


class Keeper:
    """What is known of the runs of one axis, and of its encoder's coordinates.

    Attributes:
        memory: The runs, compared.
        publisher: Who publishes the feedback; '': not known yet.
        refusal: Why the home of before the restart was not taken over, '' if it was or there was
            none.
        ended: Whether the node ends in order.
        dirty: Whether something is to be written.
        trends: What many runs say, in words.
    """

    def __init__(
        self,
        axis: Axis,
        configuration: str,
        contents: Contents,
        boot: str,
        clock: Callable[[], float],
    ) -> None:
        """Take the runs that were kept.

        Args:
            axis: The axis; it is judged from now on.
            configuration: The hash of everything that moves the origin.
            contents: What its file holds.
            boot: The boot of the host.
            clock: Returns the time of the system, s.
        """
        self.axis = axis
        self.memory = Memory(rules_of(axis.parameters), configuration)
        self.memory.replay(contents.runs)
        self.publisher = ''
        self.refusal = ''
        self.ended = False
        self.dirty = False
        self.trends: tuple[str, ...] = ()
        self._contents: Contents | None = contents  # until the home of before is decided on
        self._configuration, self._boot, self._clock = configuration, boot, clock
        self._before = contents.rest  # what the file says, as long as nothing has changed
        self._written: float | None = None  # where the axis was then
        self._known_in = ''  # the frame of what the axis remembers
        self._changed: int | None = None
        axis.judge = self.judge

    def configure(self, parameters: AxisParameters, configuration: str) -> None:
        """Use new parameters; the axis has them already."""
        if configuration != self._configuration:
            self.axis.remembered = None
        self._configuration = configuration
        self.memory.configure(rules_of(parameters), configuration)

    def look(self, publisher: str) -> None:
        """Note who publishes the feedback; other coordinates make the axis forget where it was."""
        self.publisher = publisher
        if self.axis.remembered is not None and self._known_in not in ('', self.frame):
            self.axis.remembered = None

    @property
    def frame(self) -> str:
        """What says whether raw positions can be compared: equal frames."""
        encoder = self.axis.parameters.encoder
        if encoder is Encoder.incremental:
            return f'{self._boot} {self.publisher}'
        return str(encoder)

    # ---------------------------------------------------------------------------- after a restart

    def restore(self, final: bool) -> Restored | Refused | None:
        """Take the home over from before the restart, if that is proved.

        Args:
            final: Whether a refusal stands: nothing more will be known.

        Returns:
            What became of it; None: it is not decided yet, or was before.
        """
        contents = self._contents
        if contents is None or not self.axis.readings.known:
            return None
        present = Present(self.axis.raw_position, self._configuration, self.publisher, self._boot)
        found = restored(contents, present, self.axis.parameters)
        if isinstance(found, Refused):
            if final:
                self._contents, self.refusal = None, found.text
            return found if final else None
        self._contents = self._before = None
        self.axis.restore(
            Outcome(
                Error.NoError,
                home_position_raw=found.home,
                home_offset=found.offset,
                uncertainty=found.uncertainty,
            )
        )
        self._recall(found.home)
        return found

    def recall(self) -> None:
        """Let the axis know where the newest run in these coordinates has found things."""
        self._recall(None)

    def _recall(self, home: float | None) -> None:
        for run in reversed(self.memory.runs):
            if run.configuration != self._configuration or run.home is None:
                continue
            if run.approach is not None and run.error == Error.NoError and self._same(run):
                shift = 0.0 if home is None else home - run.home
                self.axis.remembered = Remembered(
                    run.approach + shift, run.home + shift, run.uncertainty
                )
                self._known_in = self.frame
            return

    def _same(self, run: Run) -> bool:
        """Return whether the raw positions of a run mean the same now."""
        absolute = self.axis.parameters.encoder is Encoder.absolute
        return run.frame == self.frame and (absolute or bool(self.publisher))

    # ---------------------------------------------------------------------------------- each run

    def judge(self, ended: Ended) -> Outcome:
        """Compare a run with those before it, keep it, and return how it ends."""
        outcome = ended.outcome
        self._contents = self._before = None
        run = self._run_of(ended)
        judgement = self.memory.judge(run)
        if outcome.success:
            outcome = outcome._replace(warnings=(*outcome.warnings, *judgement.warnings))
            if judgement.moved and ended.kind is not RunKind.verify:
                text = (
                    f'axis {self.axis.name}: {judgement.moved}; look at the switch, then accept '
                    f'its new place with ~/{self.axis.name}/accept_home'
                )
                outcome = Outcome(Error.HomeMoved, text, warnings=outcome.warnings)
                run = run.but_moved()
            self._known_in = self.frame
        self.memory.add(run)
        self.dirty = True
        return outcome

    def accept(self) -> Run | None:
        """Begin a new baseline with the last home that was found; return its run."""
        run = self.memory.accept()
        if run is not None:
            self.dirty, self._changed = True, run.number
        return run

    def _run_of(self, ended: Ended) -> Run:
        machine, outcome, axis = ended.machine, ended.outcome, self.axis
        p = axis.parameters
        seen: list[Seen] = []
        approach = margin = None
        pitch = 0.0
        if machine is not None:
            sign = machine.parameters.home_direction.sign
            seen = [
                (str(edge.input), edge.rises, edge.way, sign * edge.position, edge.uncertainty)
                for edge in machine.seen.edges
            ]
            seen += [
                (str(one.input), None, 0, sign * one.position, 0.0) for one in machine.seen.latches
            ]
            if machine.seen.approach is not None:
                approach = sign * machine.seen.approach.position
            margin, pitch = machine.movement.index_margin, machine.movement.latches.pitch or 0.0
        home = outcome.home_position_raw if outcome.success else None
        to_index = margin * pitch if margin is not None and pitch else None
        return Run(
            number=self.memory.next_number,
            time=self._clock(),
            kind=str(ended.kind),
            error=str(outcome.error),
            duration=ended.duration,
            home=home,
            uncertainty=outcome.uncertainty,
            resolution=ended.resolution,
            fast=p.homing_velocity_fast,
            slow=p.homing_velocity_slow,
            frame=self.frame,
            configuration=self._configuration,
            quantities=self._comparable(
                quantities_of(seen, home, outcome.uncertainty, ended.resolution, to_index)
            ),
            pitch=pitch,
            seen=tuple(seen),
            approach=approach,
            temperature=axis.temperature,
        )

    def _comparable(
        self, quantities: Mapping[str, tuple[float, float]]
    ) -> Mapping[str, tuple[float, float]]:
        """Leave the raw home out if it is not known whose coordinates it is in."""
        if self.publisher or self.axis.parameters.encoder is not Encoder.incremental:
            return quantities
        return {name: pair for name, pair in quantities.items() if name != HOME}

    # -------------------------------------------------------------------------------- what is kept

    @property
    def displaced(self) -> bool:
        """Whether the axis is elsewhere than its file says."""
        if self._written is None:
            return True
        apart = abs(self.axis.raw_position - self._written)
        return apart > 0.1 * self.axis.parameters.restore_tolerance

    def snapshot(self) -> Snapshot:
        """Return what is to be written, and take it for written.

        What the file says of the axis stays as long as this node has neither found its home nor
        taken it over; but a single_turn encoder may have gone whole turns meanwhile.
        """
        self.dirty = False
        self._written = self.axis.raw_position
        changed, self._changed = self._changed, None
        axis, outcome, p = self.axis, self.axis.outcome, self.axis.parameters
        rest = Rest(
            position=axis.raw_position if axis.readings.known else None,
            homed=axis.homed,
            home=outcome.home_position_raw,
            offset=outcome.home_offset,
            uncertainty=outcome.uncertainty,
            moving=axis.running and not axis.homed,
            ended=self.ended,
            configuration=self._configuration,
            joint=p.joint or axis.name,
            encoder=str(p.encoder),
            turn=rules_of(p).turn,
            unit=str(p.unit),
            publisher=self.publisher,
            boot=self._boot,
            time=self._clock(),
        )
        before = self._before
        if before is not None and not axis.running and p.encoder is not Encoder.single_turn:
            rest = before
        return Snapshot(rest, tuple(self.memory.runs), changed)
