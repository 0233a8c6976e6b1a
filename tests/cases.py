"""Cases that only multiply what is tried: one item for all of them, which fails with all that fail."""

import inspect
from collections.abc import Callable, Collection
from functools import wraps
from typing import Any


def each(names: str | tuple[str, ...], cases: Collection[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Try every case in turn, as ``pytest.mark.parametrize`` would in items of their own.

    ``names`` are the parameters that a case gives values to. All cases share what the fixtures of the test have made.
    """
    keys = (names,) if isinstance(names, str) else names

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @wraps(test)
        def every(**fixtures: Any) -> None:
            failed = []
            for case in cases:
                given = dict(zip(keys, (case,) if isinstance(names, str) else case, strict=True))
                try:
                    test(**fixtures, **given)
                except Exception as error:
                    error.add_note(f"with {', '.join(f'{name}={value!r:.200}' for name, value in given.items())}")
                    failed.append(error)
            if failed:
                raise ExceptionGroup(f"{len(failed)} of {len(cases)} cases", failed)

        signature = inspect.signature(test)
        left = [parameter for name, parameter in signature.parameters.items() if name not in keys]
        vars(every)["__signature__"] = signature.replace(parameters=left)
        return every

    return decorate
