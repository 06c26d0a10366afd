"""What numba makes of Python functions, without importing numba where nobody did."""

from __future__ import annotations

from typing import Any


def made_of(value: Any) -> tuple[Any, ...]:
    """What a jitted function, ufunc or callback is made of; () for anything else."""
    if not type(value).__module__.startswith("numba."):
        return ()
    from numba.core import ccallback, dispatcher, extending, types
    from numba.np.ufunc import dufunc, gufunc

    made: Any = value
    if isinstance(value, dispatcher.Dispatcher):
        signatures = None if made._can_compile else [str(s) for s in made.nopython_signatures]
        return made.py_func, made.targetoptions, made.locals, signatures
    if isinstance(value, dufunc.DUFunc):
        return made._dispatcher.py_func, made.targetoptions, made.identity, made.types if made._frozen else None
    if isinstance(value, gufunc.GUFunc):
        builder = made.gufunc_builder
        return builder.py_func, builder.signature, builder.targetoptions, made.types if made._frozen else None
    if isinstance(value, ccallback.CFunc):
        return made._pyfunc, str(made._sig)
    if isinstance(value, extending._Intrinsic):
        return (made._defn,)
    return (str(made),) if isinstance(value, types.Type) else ()
