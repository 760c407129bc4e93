# SPDX-License-Identifier: Apache-2.0
"""One axis, as every check looks at it."""

from ..parameters.axis import AxisParameters
from ..plant.timing import Timing
from ..procedures.motions import Kind
from .finding import Finding, Severity


class AxisCheck:
    """A check of one axis; each check derives from it."""

    def __init__(self, axis: str, parameters: AxisParameters, timing: Timing) -> None:
        self.axis, self.p, self.timing = axis, parameters, timing
        self.rows = list(parameters.procedure.rows.values())
        self.searches = [
            (step, row)
            for step, row in parameters.procedure.rows.items()
            if row.motion.kind is Kind.SEARCH
        ]

    def found(
        self,
        severity: Severity,
        check: str,
        what: str,
        why: str,
        parameter: str = '',
        value: float | str | None = None,
        right: float | str | bool | None = None,
        unit: str = '',
    ) -> Finding:
        """Return a finding about this axis."""
        return Finding(severity, self.axis, check, what, why, parameter, value, right, unit)
