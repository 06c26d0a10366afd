"""The tables that the adapter walks, in words of 64 bits.

Filled by `cosim.fmu.adapter_tables`, read by `cosim.fmu.adapter`.

A frame is ``[fault…, instances, link, plan, (offset, stride) per argument…]``; `link` is the address of a table that
all calls of one block share, `plan` of one of the call's own. A plan lists rows, one for each variable exchanged.
"""

from cosim.compiling.frame import INSTANCES

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
TERMINATED_STATUS, LAST_TIME_STATUS = 3, 2  # fmi2StatusKind

# A frame's words before the arguments.
COUNT, LINK, PLAN, FIRST = range(INSTANCES, INSTANCES + 4)

# What all calls of a block share. Functions are addresses, 0 where the FMU has none.
LINK_WORDS = 56
(
    VERSION,
    KIND,
    RECORDS,
    STATES,
    INDICATORS,
    BUFFER,  # the states in the FMU's order
    SIGNS,  # the event indicators
    STEP,  # the address of the communication step, a float64 (s)
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
    ROW,  # the address of the row or the part that it was for, or 0
    INSTANCE,  # of which instance, from 0
    WARNINGS,
    CALLING,  # the address of the function that is being called, or was last
    CALLED,  # how often a call has begun or ended: odd inside one
    ENDING,  # the address of a word that tells the loop to do no step after this communication point
    ENDED,  # the instance that asked for the end of the simulation, from 1; 0: none
    ENDED_AT,  # when, by the loop's clock as below, a float64 (s)
    BOOLEAN_STATUS,
    REAL_STATUS,
    WARNED,  # the instance that warned first, from 1
    WARNED_AT,  # when, a float64 (s)
    ALONE,  # the address of a word that is 0 in a process that the FMU has forked
    LEAVE,  # the address of _exit()
    AGAIN,  # the address of a word that has the loop evaluate all outputs once more at this communication point
    START_TIME,  # what the FMU's clock shows at the loop's time 0, a float64 (s)
    GET_FMU_STATE,
    SET_FMU_STATE,
    SNAPSHOTS,  # the address of a pointer to the FMU state that each instance has kept
    KEPT,  # the address of a table of what of ours belongs to it: KEPT_WORDS each
    N_KEPT,
    NEXT_EVENT,  # the address of the time (s) of the next time event that anybody knows of, by the loop's clock
    LEFT,  # the address of whether outputs are wanted as they are before the events of their time
    SET_INPUT_DERIVATIVES,
    EARLY,  # the address of the time (s) at which the first has stopped within a step; 0 where none may
    DIRECTIONAL_DERIVATIVE,
    TANGENT,  # the address of how outputs are wanted of which it gives derivatives, see `cosim.master.tables`
    UNDERIVED,  # whether it has refused to
) = range(49)
#: Of the link, what a run has to tell, or to go on with.
TOLD = (WARNINGS, ENDED, ENDED_AT, WARNED, WARNED_AT, UNDERIVED)
CO_SIMULATION, EVENT_CO_SIMULATION, MODEL_EXCHANGE = range(3)
NOT_FINITE, TERMINATED, NO_PROGRESS, ENDLESS, TOO_LARGE, CROWDED = -1, -2, -3, -4, -5, -6

EVENT_INDICATORS = "event indicators"  # as a variable of a block; no variable of an FMU is called so

# What of ours belongs to a state that is kept: an address, how many words there are, and where they are kept.
KEPT_WORDS = 3
FROM, WORDS, COPIED = range(KEPT_WORDS)

# One instance. INFO is four words for what a call hands back: fmi2EventInfo, and the same layout for FMI 3.
RECORD_WORDS = 20
(
    HANDLE,
    MODE,
    EVENT_DUE,
    NEXT_DEFINED,  # whether there is a next time event
    NEXT,  # its time, a float64 (s)
    CHANGED,  # an event has set states
    INDICATOR_VALUES,
    CLOCK,  # Model Exchange: the time that the FMU was told last, a float64 (s)
    HANDLED,  # when it was in Event Mode last, a float64 (s)
    REACHED,  # the communication point that it has got to, a float64 (s)
    ENDS,  # it asked for the end of the simulation
    INFO,
) = range(12)
RUNNING, EVENT = range(2)
INFO_REAL = 24  # bytes from INFO to the number in it

# What one call exchanges. The maps give (slot, element) for each state in the FMU's order.
PLAN_WORDS = 12
FRAME_WORDS, INPUTS, N_INPUTS, OUTPUTS, N_OUTPUTS, STATE_MAP, DERIVATIVE_MAP, SETTLES, TASK, INDICATOR_SLOT = range(10)
PLAN_CURVES = 10  # the address of a table of how inputs go on in a step, 0: they are held
PLAN_TANGENT = 11  # the address of a table of the derivatives of its outputs, 0: it is evaluated

# How inputs go on: a table of inputs, and what a call is given of all: value references, orders and derivatives.
CURVES_WORDS = 6
CURVES, N_CURVES, CURVE_REFERENCES, ORDERS, VALUES, N_DERIVATIVES = range(CURVES_WORDS)

# One input: its slot, history, the highest order, how many elements it has and words all instances have, where it is
# put as it is at several times, and the matrix that makes derivatives of that.
CURVE_WORDS = 7
CURVE_SLOT, CURVE_HISTORY, CURVE_ORDER, CURVE_ELEMENTS, CURVE_WIDTH, CURVE_POINTS, CURVE_MATRIX = range(CURVE_WORDS)

# Derivatives of outputs: inputs and outputs, how many numbers these are, those of the first outputs being asked for;
# value references; what is given and taken; and the inputs and outputs that were noted, of each instance.
TANGENT_WORDS = 14
KNOWN_PARTS, N_KNOWN_PARTS, KNOWN_NUMBERS, KNOWN_REFERENCES, N_KNOWN_REFERENCES, SEED = range(6)
UNKNOWN_PARTS, N_UNKNOWN_PARTS, UNKNOWN_NUMBERS, UNKNOWN_REFERENCES, N_UNKNOWN_REFERENCES = range(6, 11)
SENSITIVITY, ASKED, POINTS = range(11, TANGENT_WORDS)
NUMBER_WORDS = 3
NUMBER_SLOT, NUMBER_COUNT, NUMBER_SINGLE = range(NUMBER_WORDS)  # single: of single precision

# One call of a getter or a setter: its value references, how many values, and the variables whose values they are, one
# after the other in a buffer (0: those of one variable, as they lie in the arena). DISCRETE: all with shadows.
ROW_WORDS = 8
FUNCTION, REFERENCES, N_REFERENCES, N_VALUES, BUFFERED, PARTS, N_PARTS, DISCRETE = range(8)

# One variable: where it is, how its values travel, how many they are, how many bytes they take in the arena and in the
# buffer, and where the value is kept that the FMU has now, 0 for nowhere.
PART_WORDS = 6
SLOT, CODE, COUNT_OF, BYTES, TRAVELLING, SHADOW = range(6)
PLAIN, FLOAT64, FLOAT32, INTEGER32, BOOLEAN32 = range(5)  # the last two, FMI 2's, are widened or narrowed on the way

MOST_ITERATIONS = 1000
MOST_EVENTS = 1_000_000  # time events at one time
ROUNDING = 1e-9  # of a communication step: what rounding may do to a time

# What a call does for each instance.
NOTHING, INITIAL, BEGIN, GET, EXCHANGE, ADVANCE, EVALUATE, DIFFERENTIATE, BEGIN_EVENTS, END_EVENTS = range(10)
KEEP_STATE, GO_BACK, INDICATE, TELL = range(10, 14)
