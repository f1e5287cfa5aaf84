"""What a record is: arrays copied, read-only, and of the shapes that it says."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt

from besman.exceptions import BesmanError

FloatArray = npt.NDArray[np.float64]

GREATEST = 1e12
"""No quantity that is stored is larger, in SI units."""


class ShapeError(BesmanError):
    """An array of a record that has the wrong shape."""


def hand_over(array: FloatArray) -> FloatArray:
    """Make an array read-only for a record to take as it is, without a copy.

    Parameters
    ----------
    array : array
        In C order, not a view of another one, and without a view that is still written to.
    """
    array.setflags(write=False)
    return array


def freeze(record: object, shapes: dict[str, tuple[int | str, ...]], **dtypes: type) -> None:
    """Copy the named arrays, make them read-only and check their shapes against each other.

    Those of another record and those handed over (`hand_over`) are read-only and taken as they are.
    A letter in a shape stands for any length, the same wherever it occurs in the record.
    """
    lengths: dict[str, int] = {}
    for name, shape in shapes.items():
        dtype = dtypes.get(name, np.float64)
        # One layout in memory, because sums over other layouts round differently.
        array: npt.NDArray[Any] = np.asarray(getattr(record, name), dtype=dtype, order="C")
        if array.flags.writeable or array.base is not None:
            array = np.array(array, order="C")
        if array.size == 0 and 0 not in array.shape[: len(shape)]:
            array = array.reshape([0 if isinstance(side, str) else side for side in shape])
        expected = [lengths.get(side, side) if isinstance(side, str) else side for side in shape]
        fits = len(array.shape) == len(shape) and all(
            isinstance(side, str) or side == got
            for side, got in zip(expected, array.shape, strict=True)
        )
        if not fits:
            sides = ", ".join(str(side) for side in expected)
            raise ShapeError(
                f"{type(record).__name__}.{name} must have shape ({sides}), got {array.shape}"
            )
        for side, got in zip(shape, array.shape, strict=True):
            if isinstance(side, str):
                lengths[side] = got
        array.setflags(write=False)
        object.__setattr__(record, name, array)


class Record:
    """A record; in another process it is made anew, so that it is checked and read-only there.

    Attributes
    ----------
    stored_as : str
        Name of the class in files. It never changes, wherever the class moves to; those with a
        module in them say where it stood when the first files were written.
    finite : tuple of str
        Fields without which a record of a file is of no use: numbers, none missing.
    distinct : tuple of str
        Fields that are names, none empty and none there twice; None is no name.
    later : tuple of str
        Fields that files of before do not have: left out of a file while they are what a file
        without them gives (`is_as_before`), so that it is written as it always was.
    """

    stored_as: ClassVar[str]
    finite: ClassVar[tuple[str, ...]] = ()
    distinct: ClassVar[tuple[str, ...]] = ()
    later: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(
        cls,
        *,
        stored_as: str,
        finite: tuple[str, ...] = (),
        distinct: tuple[str, ...] = (),
        later: tuple[str, ...] = (),
        **more: Any,
    ) -> None:
        super().__init_subclass__(**more)
        cls.stored_as = stored_as
        cls.later = (*cls.later, *later)
        cls.distinct = (*cls.distinct, *distinct)
        cls.finite = (*cls.finite, *finite)

    def check(self) -> None:
        """Refuse values that no file of besman has; called for what is read from one.

        Raises
        ------
        ShapeError
            If a field of `finite` holds a number that is none, or larger than any quantity in SI
            units, or `time` does not rise; if a name of a field of `distinct` is empty or there
            twice.
        """
        for name in self.finite:
            values = np.asarray(getattr(self, name))
            # NaN is not below anything.
            if not np.all(np.abs(values) <= GREATEST):
                raise ShapeError(
                    f"{type(self).__name__}.{name} must be finite and within {GREATEST:g}"
                )
            if name == "time" and np.any(np.diff(values) <= 0):
                raise ShapeError(f"{type(self).__name__}.time must rise strictly")
        for field in self.distinct:
            names = [name for name in getattr(self, field) if name is not None]
            if len(set(names)) < len(names) or not all(name.strip() for name in names):
                raise ShapeError(
                    f"{type(self).__name__}.{field} must be names, none empty and none twice"
                )

    def is_as_before(self, name: str) -> bool:
        """Tell whether a field of `later` is what a file without it gives: its default."""
        if name not in self.later:
            return False
        one = next(one for one in fields(cast(Any, self)) if one.name == name)
        value = getattr(self, name)
        if one.default_factory is not MISSING:
            return np.array_equal(value, one.default_factory())
        return value is None or bool(value == one.default)

    def __reduce__(self) -> tuple[Any, ...]:
        values = {one.name: getattr(self, one.name) for one in fields(cast(Any, self))}
        return _make, (type(self), values)


def _make(kind: type[Any], values: dict[str, Any]) -> Any:
    """Make a record of its fields."""
    return kind(**values)
