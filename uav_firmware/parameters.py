"""Parameters: declared beside each module, registered once, changed by MAVLink, saved.

A module declares a frozen dataclass whose fields are made by `param`:

    @dataclass(frozen=True, slots=True, kw_only=True)
    class PositionControlParams:
        xy_p: float = param("MPC_XY_P", 0.95, unit="1/s", minimum=0.0, maximum=2.0,
                            short="Corrective velocity per metre of horizontal position error")

`Registry.add(PositionControlParams)` registers its parameters; `Registry.read(...)` gives an
instance with the present values; `Registry.version` grows at each change, so a module
re-reads only when it differs. Names and types are PX4's: int is INT32, float is REAL32.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias, TypeVar

P = TypeVar("P")
_METADATA = "parameter"

ParameterValue: TypeAlias = float | int
"""An int is an INT32, a float a REAL32. A compiled function takes an int for a `float` as 1.0."""


class ParameterError(Exception):
    """Base of all parameter faults.

    ParameterError
      +- UnknownParameterError    no such name
      +- ParameterRangeError      outside minimum..maximum, or not finite
      +- ParameterTypeError       a fraction or a bool for an integer parameter
      +- ParameterLockedError     cannot be changed while the vehicle is armed
    """


class UnknownParameterError(ParameterError):
    """No parameter has this name."""


class ParameterRangeError(ParameterError):
    """The value lies outside the declared range or is not finite."""


class ParameterTypeError(ParameterError):
    """The value does not fit the declared type."""


class ParameterLockedError(ParameterError):
    """The parameter describes the vehicle itself and cannot be changed while it is armed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Declaration:
    """One parameter as its module declares it."""

    name: str  # PX4's name, at most 16 characters
    default: float | int
    unit: str
    minimum: float
    maximum: float
    short: str
    is_integer: bool
    values: Mapping[int, str] = field(default_factory=dict)  # Meaning of each value
    bits: Mapping[int, str] = field(default_factory=dict)  # Meaning of each bit, from 0
    is_volatile: bool = False  # A ground station that keeps values leaves it out of the hash
    locked_while_armed: bool = False
    read_at_start: bool = False  # A change takes effect at the next start
    least_if_on: float = 0.0  # 0 switches off; any other value is at least this

    @property
    def is_read_only(self) -> bool:
        """Whether it has one value: a fact about the vehicle."""
        return self.minimum == self.maximum

    @property
    def meaning(self) -> str:
        """The description in one sentence, with the meaning of each value or bit."""
        named = [f"{value} {text}" for value, text in self.values.items()]
        named += [f"bit {bit} {text}" for bit, text in self.bits.items()]
        return f"{self.short}: {', '.join(named)}" if named else self.short


def param(
    name: str,
    default: float,
    *,
    unit: str,
    minimum: float,
    maximum: float,
    short: str,
    values: Mapping[int, str] | None = None,
    bits: Mapping[int, str] | None = None,
    volatile: bool = False,
    locked_while_armed: bool = False,
    read_at_start: bool = False,
    least_if_on: float = 0.0,
) -> Any:
    """Declare a parameter as a dataclass field; an int default makes an INT32.

    `values` names what each value of an integer selects, `bits` what each bit does: ground stations
    offer the values of a parameter by these names, and none without them.

    A `volatile` one may change by itself: the vehicle's hash of all parameters excludes it, and
    its metadata mark it, so that a ground station excludes it too.

    `locked_while_armed` is for what describes the vehicle, such as where its rotors are: a change
    in flight would take the control away, whatever the value. What is tuned in flight has
    bounds within which the vehicle stays in control instead.

    `read_at_start` is for what is read once: a ground station asks for a restart after a change.

    `least_if_on` is for a limit that 0 switches off: values between 0 and it are refused.
    """
    if len(name) > 16:
        raise ParameterTypeError(f"{name}: longer than 16 characters")
    declaration = Declaration(
        name=name,
        default=default,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        short=short,
        is_integer=isinstance(default, int),
        values=values or {},
        bits=bits or {},
        is_volatile=volatile,
        locked_while_armed=locked_while_armed,
        read_at_start=read_at_start,
        least_if_on=least_if_on,
    )
    return field(default=default, metadata={_METADATA: declaration})


_LARGEST_REAL32 = 3.4028234663852886e38


def _as_real32(value: float) -> float:
    """Round to what four bytes hold, so that a value reads back as it was stored."""
    rounded: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return rounded


def _default_of(declaration: Declaration) -> float | int:
    return declaration.default if declaration.is_integer else _as_real32(declaration.default)


class Registry:
    """All parameters of a vehicle with their present values."""

    def __init__(self) -> None:
        self._declarations: dict[str, Declaration] = {}
        self._values: dict[str, float | int] = {}
        self.version: int = 0
        self.armed = False  # Written by the commander
        self._put_back: list[str] = []

    def add(self, group: type[Any]) -> None:
        """Register every parameter that a module's dataclass declares.

        Increments the version, for readers of a name that may be declared later.
        """
        self.declare(entry.metadata[_METADATA] for entry in fields(group))

    def declare(self, declarations: Iterable[Declaration]) -> None:
        """Register parameters that no dataclass declares; increments the version."""
        for declaration in declarations:
            if declaration.name in self._declarations:
                raise ParameterError(f"{declaration.name}: declared twice")
            self._declarations[declaration.name] = declaration
            self._values[declaration.name] = _default_of(declaration)
        self.version += 1

    def read(self, group: type[P]) -> P:
        """Give an instance of a module's dataclass with the present values."""
        return group(
            **{
                entry.name: self._values[entry.metadata[_METADATA].name]
                for entry in fields(group)  # type: ignore[arg-type]  # P is a dataclass
            }
        )

    def names(self) -> list[str]:
        """All names, sorted: the index of a name is stable while the firmware is the same."""
        return sorted(self._declarations)

    def declaration(self, name: str) -> Declaration:
        """Give the declaration of `name`.

        Raises:
            UnknownParameterError: if there is none.
        """
        try:
            return self._declarations[name]
        except KeyError:
            raise UnknownParameterError(f"{name}: no such parameter") from None

    def get(self, name: str) -> float | int:
        """Give the present value of `name`; raises UnknownParameterError."""
        self.declaration(name)
        return self._values[name]

    def set(self, name: str, value: float) -> None:
        """Change a value.

        Raises:
            UnknownParameterError: if the name is unknown.
            ParameterTypeError: if an integer parameter is given a fraction.
            ParameterRangeError: if the value is not finite or out of range. A REAL32 is held
                against its bounds as four bytes carry them, since that is how a value arrives.
            ParameterLockedError: if it cannot be changed while the vehicle is armed.
        """
        declaration = self.declaration(name)
        if isinstance(value, bool) or not math.isfinite(value):
            raise ParameterRangeError(f"{name}: {value} is not a finite number")
        if declaration.is_integer and value != int(value):
            raise ParameterTypeError(f"{name}: {value} is not an integer")
        if not declaration.is_integer and abs(value) <= _LARGEST_REAL32:
            value = _as_real32(value)
            minimum, maximum = _as_real32(declaration.minimum), _as_real32(declaration.maximum)
        else:
            minimum, maximum = declaration.minimum, declaration.maximum
        if not minimum <= value <= maximum:
            raise ParameterRangeError(
                f"{name}: {value} is outside {declaration.minimum}..{declaration.maximum}"
            )
        if 0.0 < value < declaration.least_if_on:
            raise ParameterRangeError(
                f"{name}: {value} is neither 0 nor at least {declaration.least_if_on:g}"
            )
        stored = int(value) if declaration.is_integer else value
        if declaration.locked_while_armed and self.armed and stored != self._values[name]:
            raise ParameterLockedError(f"{name}: cannot be changed while armed")
        self._values[name] = stored
        self.version += 1

    def put_back(self, name: str) -> None:
        """Give a parameter that is an order its default again, once it has been carried out."""
        self._values[name] = _default_of(self.declaration(name))
        self._put_back.append(name)
        self.version += 1

    def take_put_back(self) -> list[str]:
        """Names of parameters that the vehicle itself has changed since the last call."""
        names, self._put_back = self._put_back, []
        return names

    def reset(self) -> None:
        """Put every value back to its default."""
        for name, declaration in self._declarations.items():
            self._values[name] = _default_of(declaration)
        self.version += 1

    def changed(self) -> dict[str, float | int]:
        """Values that differ from their defaults."""
        return {
            name: value
            for name, value in self._values.items()
            if value != _default_of(self._declarations[name])
        }

    def load(self, values: Mapping[str, float]) -> list[str]:
        """Set stored values; returns a sentence for each one that no longer fits."""
        faults = []
        for name, value in values.items():
            try:
                self.set(name, value)
            except ParameterError as error:
                faults.append(str(error))
        return faults
