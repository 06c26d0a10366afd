"""The tables that the adapter walks, in words of 64 bits: filled by `cosim.fmu.instance`, read by `cosim.fmu.adapter`.

A frame is ``[fault, instances, link, plan, (offset, stride) per argument…]``; `link` is the address of a table that all
calls of one block share, `plan` of one that belongs to the call. A plan lists rows, one for each variable exchanged.
"""

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

# A frame's words before the arguments.
FAULT, COUNT, LINK, PLAN, FIRST = range(5)

# What all calls of a block share. Functions are addresses, 0 where the FMU has none.
LINK_WORDS = 32
(
    VERSION,
    KIND,
    RECORDS,
    STATES,
    INDICATORS,
    BUFFER,  # the states in the FMU's order
    SIGNS,  # the event indicators
    STEP,  # communication step, a float64 (s)
    EXIT_INITIALIZATION,
    SET_TIME,
    SET_STATES,
    GET_STATES,
    GET_DERIVATIVES,
    GET_INDICATORS,
    COMPLETED_STEP,
    ENTER_EVENT_MODE,
    UPDATE_DISCRETE_STATES,
    LEAVE_EVENT_MODE,
    DO_STEP,
    STATUS,  # of the call that failed
    FAILED,  # its address, or one of the reasons below
    ROW,  # the address of the row that it was for, or 0
    INSTANCE,  # of which instance, from 0
    WARNINGS,
    CALLING,  # the address of the function that is being called, or was last
    CALLED,  # how many calls there have been
) = range(26)
CO_SIMULATION, EVENT_CO_SIMULATION, MODEL_EXCHANGE = range(3)
NOT_FINITE, TERMINATED, NO_PROGRESS, ENDLESS, TOO_LARGE = -1, -2, -3, -4, -5

# One instance. INFO is four words for what a call hands back: fmi2EventInfo, and the same layout for FMI 3.
RECORD_WORDS = 12
HANDLE, MODE, STEPPED, EVENT_DUE, NEXT_DEFINED, NEXT, CHANGED, INDICATOR_VALUES, INFO = range(9)
RUNNING, EVENT = range(2)
INFO_REAL = 24  # bytes from INFO to the number in it

# What one call exchanges. The maps give (slot, element) for each state in the FMU's order.
PLAN_WORDS = 9
FRAME_WORDS, INPUTS, N_INPUTS, OUTPUTS, N_OUTPUTS, STATE_MAP, DERIVATIVE_MAP, SETTLES, TASK = range(9)

# One variable: the getter or setter, its value references, how many values, and where they are.
ROW_WORDS = 10
FUNCTION, REFERENCES, N_REFERENCES, N_VALUES, SLOT, CODE, STAGING, SHADOW, BYTES = range(9)
PLAIN, FLOAT64, FLOAT32, INTEGER32, BOOLEAN32 = range(5)  # the last two, FMI 2's, are widened or narrowed in STAGING

MOST_ITERATIONS = 1000

# What a call does for each instance.
INITIAL, BEGIN, GET, EXCHANGE, ADVANCE, EVALUATE, DIFFERENTIATE, HANDLE_EVENTS = range(8)
