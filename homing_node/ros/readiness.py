# SPDX-License-Identifier: Apache-2.0
"""Why an axis cannot home now, for the reasons that only the node knows."""

from collections.abc import Callable, Iterable, Mapping

from ..core.outcome import Outcome, together
from ..core.shared_signals import SharedSignals
from ..procedures.states import Error
from .controllers import Controllers
from .handovers import Handovers
from .inputs import Inputs
from .joint_order import JointOrder
from .setpoints import Setpoints
from .timebase import TimeBase

#: Simulated time is 0 until /clock is heard, s.
FIRST_INSTANT = 1e-9


class Readiness:
    """Looks at everything that a run needs besides its axis."""

    def __init__(
        self,
        faults: Callable[[], Mapping[str, tuple[str, ...]]],
        inputs: Inputs,
        shared_signals: SharedSignals,
        controllers: Controllers,
        handovers: Handovers,
        order: JointOrder | None,
        setpoints: Setpoints,
        timebase: TimeBase,
        publishers_of: Callable[[str], list[str]],
        any_run: Callable[[], bool],
        forbidden: Callable[[str], Outcome | None],
        drives_of: Callable[[str], Iterable[str]],
    ) -> None:
        """Keep what is looked at.

        Args:
            faults: Returns the contradictions between the parameters of each axis, by its name.
            inputs: The inputs of the axes.
            shared_signals: Which inputs read the same signal.
            controllers: Who plays the setpoints.
            handovers: The hand-overs of the homes.
            order: The order of the joints in an array of positions, if setpoints are such arrays.
            setpoints: The interface of the setpoints.
            timebase: The clock of the node.
            publishers_of: Returns the nodes that publish on a topic.
            any_run: Returns whether a run is on.
            forbidden: Returns why others let an axis not home: a lock, a node that is not active.
            drives_of: Returns the full names of the drives of an axis.
        """
        self._faults, self._inputs, self._shared_signals = faults, inputs, shared_signals
        self._controllers, self._order, self._setpoints = controllers, order, setpoints
        self._handovers = handovers
        self._timebase, self._publishers_of, self._any_run = timebase, publishers_of, any_run
        self._forbidden = forbidden
        self._drives_of = drives_of

    def unready(self, name: str) -> Outcome | None:
        """Return why an axis cannot home now, else None."""
        wrong = self._wrong(name)
        missing = [] if wrong else self._missing(name)
        return together(missing) if missing else wrong

    def _wrong(self, name: str) -> Outcome | None:
        """Return why an axis cannot home for a reason that waiting does not mend, else None."""
        forbidden = self._forbidden(name)
        if forbidden is not None:
            return forbidden
        faults = self._faults()
        if name in faults:
            return Outcome(Error.InvalidParameter, '; '.join(faults[name]))
        for drive in self._drives_of(name):
            wrong = self._inputs.conflict(drive, self._publishers_of)
            wrong = wrong or self._shared_signals.refusal(drive)
            if wrong is not None:
                return wrong
        return (
            self._handovers.wrong(name)
            or self._controllers.conflict()
            or self._controllers.verdict.wrong
            or (self._order and self._order.wrong)
        )

    def _missing(self, name: str) -> list[Outcome]:
        """Return everything that an axis still needs for a run."""
        if self._timebase.now < FIRST_INSTANT:
            text = 'use_sim_time is true, but /clock was not heard, or is at 0'
            return [Outcome(Error.FeedbackStale, text)]
        missing = [one for drive in self._drives_of(name) for one in self._inputs.missing(drive)]
        others = self._setpoints.unready()
        if others is not None:
            missing.append(others)
        verdict = self._controllers.verdict
        missing += verdict.missing
        inactive = self._handovers.missing(name)
        missing += [] if inactive is None else [inactive]
        if self._order and not missing and not verdict.proven and not self._any_run():
            unproven = self._order.missing
            missing += [] if unproven is None else [unproven]
        return missing
