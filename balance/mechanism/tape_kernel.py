"""The loop that runs a tape of arithmetic (see :mod:`.tape`), for the compiler.

Only the process that compiles imports this module. Registers are rows of LANES samples, so that each operation is a
short loop for the processor's vector unit.
"""

from typing import Any

from numba import carray, cfunc, types

LANES = 64
_ROUND = 6755399441055744.0
"""1.5 x 2**52: what is added to it is rounded to a whole number."""
_TWO_BY_PI = 0.6366197723675814
_FIRST, _SECOND, _THIRD = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""pi/2 in three parts, the first two of 33 bits: whole multiples up to 2**20 are exact (fdlibm, e_rem_pio2.c)."""
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
"""Polynomials of sine and cosine up to pi/4 (fdlibm, k_sin.c and k_cos.c)."""


def run_tape(
    code_at: Any, length: Any, space_at: Any, values_at: Any, constants: Any, memory_at: Any, rows_at: Any, inputs: Any,
    count: Any,
) -> Any:  # fmt: skip
    """Run ``length`` operations on ``count`` samples; ``rows_at`` has where the rows of inputs, then outputs begin."""
    code, registers = carray(code_at, (length, 5)), carray(space_at, (1 << 30, LANES))
    values, memory, rows = carray(values_at, constants), carray(memory_at, 1 << 60), carray(rows_at, 1 << 30)
    for i in range(constants):
        for k in range(LANES):
            registers[i, k] = values[i]
    start = 0
    while start < count:
        here = min(LANES, count - start)
        for i in range(length):
            op = code[i, 0]
            d, a, b, c = registers[code[i, 1]], registers[code[i, 2]], registers[code[i, 3]], registers[code[i, 4]]
            if op == 4:
                for k in range(LANES):
                    d[k] = a[k] * b[k]
            elif op == 7:
                for k in range(LANES):
                    d[k] = c[k] + a[k] * b[k]
            elif op == 8:
                for k in range(LANES):
                    d[k] = c[k] - a[k] * b[k]
            elif op == 9:
                for k in range(LANES):
                    d[k] = a[k] * b[k] - c[k]
            elif op == 2:
                for k in range(LANES):
                    d[k] = a[k] + b[k]
            elif op == 3:
                for k in range(LANES):
                    d[k] = a[k] - b[k]
            elif op == 5:
                for k in range(LANES):
                    d[k] = -a[k]
            elif op == 0:
                at = rows[code[i, 2]] + start
                row = memory[at : at + here]
                for k in range(here):
                    d[k] = row[k]
            elif op == 1:
                at = rows[inputs + code[i, 1]] + start
                row = memory[at : at + here]
                for k in range(here):
                    row[k] = a[k]
            elif op == 6:
                for k in range(LANES):
                    d[k] = 1.0 / a[k]
            elif op == 10:
                for k in range(LANES):
                    x = a[k]
                    shifted = x * _TWO_BY_PI + _ROUND
                    n = shifted - _ROUND
                    y = ((x - n * _FIRST) - n * _SECOND) - n * _THIRD
                    z = y * y
                    sine = y + y * z * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
                    cosine = 1.0 - 0.5 * z + z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6)))))
                    half = n * 0.5
                    odd = half - ((half + _ROUND) - _ROUND)  # 0, or 0.5 or -0.5 where n is odd
                    quarter = n * 0.25
                    phase = quarter - ((quarter + _ROUND) - _ROUND)  # n mod 4, as -0.5, -0.25, 0, 0.25 or 0.5
                    swapped = odd != 0.0
                    s = cosine if swapped else sine
                    t = sine if swapped else cosine
                    d[k] = -s if (phase < -0.1 or phase > 0.4) else s
                    b[k] = -t if (phase > 0.1 or phase < -0.4) else t
            elif op == 11:
                for k in range(LANES):
                    x = a[k]
                    d[k] = 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)
            elif op == 12:
                for k in range(LANES):
                    x, y = abs(a[k]), abs(b[k])
                    d[k] = y if y > x or y != y else x
        start += LANES
    return 0


def compiled() -> str:
    """The loop for this processor, as text that LLVM takes; its entry is called ``run_tape``."""
    whole, numbers = types.CPointer(types.int64), types.CPointer(types.float64)
    signature = types.int64(
        types.CPointer(types.int32), types.int64, numbers, numbers, types.int64, numbers, whole, types.int64,
        types.int64,
    )  # fmt: skip
    function = cfunc(signature, error_model="numpy")(run_tape)
    return str(function.inspect_llvm()).replace(function.native_name, run_tape.__name__)
