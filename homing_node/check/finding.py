# SPDX-License-Identifier: Apache-2.0
"""A finding of a check."""

from collections.abc import Callable, Iterable
from math import ceil, floor, isfinite, log10
from typing import NamedTuple

from ..parameters.units import Unit
from ..procedures.states import TextEnum


class Severity(TextEnum):
    """How bad a finding is."""

    error = 'error'  # a run fails, or something is hit
    warning = 'warning'  # it works, but not as it should, or not always
    info = 'info'  # worth knowing


class Finding(NamedTuple):
    """One finding about an axis, or about the whole node (axis '').

    Attributes:
        check: The word for this kind of finding.
        what: What is found, with the numbers.
        why: Why it is a fault.
        parameter: The parameter to change, or the key of the layout.
        value: The number that is found, in ``unit``.
        right: What ``parameter`` should be, in ``unit``.
        also: A parameter that must have the same value then.
    """

    severity: Severity
    axis: str
    check: str
    what: str
    why: str
    parameter: str = ''
    value: float | str | None = None
    right: float | str | bool | None = None
    unit: str = ''
    also: str = ''

    @property
    def text(self) -> str:
        """The finding in one line."""
        subject = f'axis {self.axis}: ' if self.axis else ''
        return f'{subject}{self.what}; {self.why}{self.remedy and "; " + self.remedy}'

    @property
    def remedy(self) -> str:
        """The parameter and the value that would be right, '' where there is nothing to set."""
        if self.right is None:
            return ''
        right = self.right
        if isinstance(right, bool):
            right = str(right).lower()
        elif isinstance(right, float):
            right = f'{right:.6g} {self.unit}'.rstrip()
        names = ' and '.join(filter(None, (self.parameter, self.also)))
        return f'{names}: {right}' if names else str(right)

    def as_dict(self) -> dict[str, object]:
        """Return it as plain values; numbers that JSON does not know are left out."""
        plain: dict[str, object] = {**self._asdict(), 'severity': str(self.severity)}
        return {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in plain.items()
        }


def in_unit(finding: Finding, unit: Unit) -> Finding:
    """Return a finding in the unit of its axis."""
    return finding._replace(
        what=unit.in_message(finding.what),
        why=unit.in_message(finding.why),
        unit=unit.of(finding.unit),
    )


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings by axis, the worst first; of equals (but for numbers) only the worst."""
    rank = list(Severity)
    kept: dict[tuple[str, str, str], Finding] = {}
    order: dict[str, int] = {}
    for one in findings:
        order.setdefault(one.axis, len(order))
        key = one.axis, one.check, one.what
        if key not in kept or rank.index(one.severity) < rank.index(kept[key].severity):
            kept[key] = one
    return sorted(kept.values(), key=lambda one: (order[one.axis], rank.index(one.severity)))


def down(number: float) -> float:
    """Round down to two digits: a value that one would write into a file."""
    return _digits(number, floor)


def up(number: float) -> float:
    """Round up to two digits."""
    return _digits(number, ceil)


def _digits(number: float, way: Callable[[float], int]) -> float:
    if number <= 0.0 or not isfinite(number):
        return number
    step = floor(log10(number)) - 1
    scaled = number * 10.0**-step
    # A number that has two digits stays, whatever its last bit says.
    whole = round(scaled) if abs(scaled - round(scaled)) < 1e-9 * scaled else way(scaled)
    return float(f'{whole}e{step}')
