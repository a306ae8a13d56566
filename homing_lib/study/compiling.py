"""Loads the compiled code of `compiled`, where numba is installed, and compiles lambda rules for it to call.

What numba has compiled is kept in a folder of the checkout, else in one of the user's, under the hash of the code,
since numba itself may go by the age of a file. A rule is compiled anew in each process, in a third of a second.
"""

import builtins
import dis
import hashlib
import inspect
import math
import operator
import os
import sys
import threading
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from types import CellType, CodeType, FunctionType
from typing import Any

import numpy as np
import platformdirs
from scipy.linalg.blas import ddot
from tqdm import tqdm

from homing_lib.lambdas import Derived
from homing_lib.storage import MARK, ROOT


class ForPython(Exception):
    """Not for the compiled code: it knows no such run, or something goes wrong in it, and Python has to say what."""


# --- The compiled code ------------------------------------------------------------------------------------------------


@cache
def load() -> Any:
    """The module `compiled`; or None, and once a line that says why, where it cannot be compiled."""
    slower = "runs take ten times as long; their results are the same"
    try:
        import numba
    except Exception as error:  # a broken one raises what it likes
        _say(f"numba cannot be loaded ({_short(error)}): {slower}")
        return None
    config: Any = numba.config
    own, config.CACHE_DIR = config.CACHE_DIR, _folder()
    try:
        from homing_lib.study import compiled

        compiled.warm()
        return compiled
    except Exception as error:
        _say(f"the engine cannot be compiled ({_short(error)}): {slower}")
        return None
    finally:
        config.CACHE_DIR = own


def _folder() -> str:
    """Where what is compiled is kept: in the checkout, else with the user's files; "" where neither can be written."""
    files = [Path(__file__).with_name(name) for name in ("compiled_world.py", "compiled.py")]
    key = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    checkout = [ROOT / ".build"] if (ROOT / MARK).exists() else []
    for place in (*checkout, platformdirs.user_cache_path("homing")):
        folder = place / "numba" / key
        with suppress(OSError):
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            TemporaryFile(dir=folder).close()  # tried here, since numba would choose another place without a word
            if is_new:
                tqdm.write("homing: compiling the engine, once; this may take half a minute", file=sys.stderr)
            return str(folder)
    _say(f"compiled code cannot be kept in {folder}: it is compiled anew each time, in fifteen seconds")
    return ""


_SAID = "HOMING_ENGINE_SAID"


def _say(line: str) -> None:
    """Once, and not again by the processes that this one starts."""
    if _SAID not in os.environ:
        os.environ[_SAID] = "1"
        tqdm.write(f"homing: {line}", file=sys.stderr)


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


# --- A lambda rule ----------------------------------------------------------------------------------------------------

_RULES: dict[Any, Any] = {}  # compiled rules, or None for those that cannot be, by all that they depend on
_lock = threading.Lock()
_ADAPTER = """
def adapter(delta, phi, delta_prev, phi_prev, trace_prev, discount):
    try:
        return 1.0 * {call}
    except Exception:
        return nan
"""


def compiled_rule(rule: Any) -> Any:
    """A rule compiled, to be called as `compiled.RULE` says. Where it raises, it returns NaN. Raises ForPython."""
    try:
        key = _content(rule)
    except (ValueError, RecursionError):  # a name without a value; a function that calls itself
        raise ForPython from None
    with _lock:  # for threads that compile at once; warnings are silenced for all of them
        if key not in _RULES:
            try:
                _RULES[key] = _adapted(rule)
            except Exception:  # numba raises what it likes
                _RULES[key] = None
    if _RULES[key] is None:
        raise ForPython
    return _RULES[key]


def _adapted(rule: Any) -> Any:
    from numba import cfunc, njit

    compiled, changes = load(), []
    while isinstance(rule, Derived):
        changes.append(rule.change)
        rule = rule.rule
    parameters = inspect.signature(rule).parameters.values()
    takes = [one.name for one in parameters if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)]
    known = {"delta", "phi", "delta_prev", "phi_prev", "trace_prev", "discount"}
    names: dict[str, Any] = {"nan": math.nan, "rule": njit(_positional(rule))}
    defaults = {one.name: one.default for one in parameters if one.name not in known and one.name in takes}
    names |= {f"default_{name}": _for_numba(value) for name, value in defaults.items()}
    call = f"rule({', '.join(name if name in known else f'default_{name}' for name in takes)})"
    for number, change in enumerate(reversed(changes)):
        names[f"change{number}"] = _for_numba(change)
        call = f"change{number}({call})"
    exec(_ADAPTER.format(call=call), names)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cfunc(compiled.RULE)(names["adapter"])


# --- What a rule may use: what numba computes to the last bit as Python and NumPy do ----------------------------------

_MODULES_AND_FUNCTIONS: tuple[Any, ...] = (
    *(math, math.isfinite, math.isnan, math.sqrt, math.fabs),
    *(np, np.dot, np.sqrt, np.abs, np.sign, np.isfinite, np.isnan, np.add, np.subtract, np.multiply),
    *(operator, operator.neg, ddot, abs, min, max, float, bool, len, range),
)
_ATTRIBUTES = ("isfinite", "isnan", "sqrt", "fabs", "dot", "abs", "absolute", "sign", "neg", "size", "shape")
_NO_OPERATORS = ("**", "**=", "%", "%=", "//", "//=", "<<", "<<=", ">>", ">>=")
_ERRORS = ("ArithmeticError", "ZeroDivisionError", "OverflowError", "ValueError", "Exception")
_NO_PLAIN_FUNCTION = inspect.CO_VARARGS | inspect.CO_GENERATOR | inspect.CO_COROUTINE | inspect.CO_ASYNC_GENERATOR


@cache
def _dots_agree() -> bool:
    """Whether NumPy's own linear algebra multiplies vectors as SciPy's does, which the compiled code calls."""
    rng = np.random.default_rng(0)
    pairs = (rng.random((2, n)) for n in (3, 258, 516, 774) for _ in range(16))
    return all(float(x @ y) == float(np.dot(x, y)) == ddot(x, y) for x, y in pairs)


@cache
def _names(code: CodeType) -> tuple[str, ...]:
    """The names that a function looks up outside itself. Raises ForPython if it does more than a rule may."""
    count = code.co_argcount + code.co_kwonlyargcount
    keywords = code.co_varnames[count : count + 1] if code.co_flags & inspect.CO_VARKEYWORDS else ()
    if code.co_flags & _NO_PLAIN_FUNCTION or any(isinstance(one, CodeType) for one in code.co_consts):
        raise ForPython
    for step in dis.get_instructions(code):
        names = step.argval if isinstance(step.argval, tuple) else (step.argval,)
        if (step.argrepr == "@" or step.argval == "dot") and not _dots_agree():
            raise ForPython
        stores = step.opname.startswith(("STORE_GLOBAL", "STORE_DEREF", "STORE_ATTR", "DELETE_"))
        unknown = step.opname in ("LOAD_ATTR", "LOAD_METHOD") and step.argval not in _ATTRIBUTES
        if stores or unknown or step.argrepr in _NO_OPERATORS or any(name in keywords for name in names):
            raise ForPython
    return tuple({step.argval: 0 for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"})


def _outside(function: FunctionType) -> dict[str, Any]:
    """What a function looks up outside itself, by name; errors apart. Raises ForPython as `_names` does."""
    names = [name for name in _names(function.__code__) if name not in _ERRORS]
    return {name: function.__globals__.get(name, getattr(builtins, name, None)) for name in names}


def _content(value: Any) -> Any:
    """All that a function, or what it looks up outside itself, depends on, hashable. Raises ForPython."""
    if isinstance(value, Derived):
        return "derived", _content(value.rule), _content(value.change)
    if isinstance(value, FunctionType):
        outside = tuple((name, _content(one)) for name, one in _outside(value).items())
        cells = tuple(_content(cell.cell_contents) for cell in value.__closure__ or ())
        defaults = tuple(map(_content, (*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values())))
        return value.__code__, defaults, outside, cells
    if isinstance(value, bool | int | float | np.number):
        return type(value), repr(value)
    if any(value is one for one in _MODULES_AND_FUNCTIONS):
        return id(value)
    raise ForPython


_FOR_NUMBA: tuple[tuple[Any, Any], ...] = (
    (ddot, lambda x, y: np.dot(x, y)),
    (float, lambda x: 1.0 * x),  # numba knows no float(True)
    (max, lambda a, b: b if b > a else a),  # the first of equals, as Python has it: 0 and -0 are two
    (min, lambda a, b: b if b < a else a),
)
"""What numba lacks, or does otherwise, and what does the same."""


def _for_numba(value: Any) -> Any:
    """What numba takes in the place of a value: functions compiled, all else as it is."""
    from numba import njit

    for function, does_the_same in _FOR_NUMBA:
        if value is function:
            return njit(does_the_same)
    return njit(_positional(value)) if isinstance(value, FunctionType) else value


def _positional(function: FunctionType) -> FunctionType:
    """The function with its keywords as positions and without **_; what it looks up outside itself is as it is now."""
    code = function.__code__
    outside = {name: _for_numba(value) for name, value in _outside(function).items()}
    cells = tuple(CellType(_for_numba(cell.cell_contents)) for cell in function.__closure__ or ())
    count = code.co_argcount + code.co_kwonlyargcount
    flags = code.co_flags & ~inspect.CO_VARKEYWORDS
    flat = code.replace(co_argcount=count, co_kwonlyargcount=0, co_posonlyargcount=0, co_flags=flags)
    defaults = None if code.co_kwonlyargcount else function.__defaults__
    return FunctionType(flat, outside, function.__name__, defaults, cells or None)
