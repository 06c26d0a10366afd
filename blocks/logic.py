"""Truth values: comparisons, connectives, edges, latches, and a machine of states from a table."""

import numpy as np

from cosim import Block, Indicator, Input, Output, Parameter, State, rule


class Compare(Block):
    """Whether a signal is above a threshold, and not below again before it is lower by the hysteresis.

    ::

        above = u > threshold;   once above, u > threshold - hysteresis

    It changes at an event.
    """

    u = Input("n?", description="signal")
    threshold = Parameter("n?", default=0.0, description="threshold")
    hysteresis = Parameter("n?", default=0.0, description="how far u has to fall below it again")
    on = State("n?", dtype=bool, start=False, description="whether it is above")
    crossed = Indicator("n?", crossing="rising", description="how far u is beyond the next threshold")
    above = Output("n?", dtype=bool, unit="1", description="whether u is above")

    positive = rule("hysteresis >= 0")(lambda hysteresis: bool(np.all(hysteresis >= 0.0)))

    def start(u, threshold, on):
        for q in range(on.size):
            on[q] = u[q] > threshold[q]

    def outputs(on, above):
        for q in range(above.size):
            above[q] = on[q]

    def indicators(u, threshold, hysteresis, on, crossed):
        for q in range(u.size):
            crossed[q] = threshold[q] - hysteresis[q] - u[q] if on[q] else u[q] - threshold[q]

    def event(crossed, on, next_on):
        for q in range(crossed.size):
            if crossed[q] > 0:
                next_on[q] = not on[q]


class And(Block):
    """Whether both are true.

    ::

        y = u_1 and u_2
    """

    u_1 = Input("n?", dtype=bool, unit="1", description="first truth value")
    u_2 = Input("n?", dtype=bool, unit="1", description="second truth value")
    y = Output("n?", dtype=bool, unit="1", description="whether both are")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = u_1[q] and u_2[q]


class Or(Block):
    """Whether one of two is true, or both are.

    ::

        y = u_1 or u_2
    """

    u_1 = Input("n?", dtype=bool, unit="1", description="first truth value")
    u_2 = Input("n?", dtype=bool, unit="1", description="second truth value")
    y = Output("n?", dtype=bool, unit="1", description="whether one is")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = u_1[q] or u_2[q]


class Not(Block):
    """Whether it is false.

    ::

        y = not u
    """

    u = Input("n?", dtype=bool, unit="1", description="truth value")
    y = Output("n?", dtype=bool, unit="1", description="the opposite")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = not u[q]


class Number(Block):
    """A truth value as a number, for blocks that compute with it.

    ::

        y = true_value if u else false_value
    """

    u = Input("n?", dtype=bool, unit="1", description="truth value")
    true_value = Parameter("n?", default=1.0, description="number for true")
    false_value = Parameter("n?", default=0.0, description="number for false")
    y = Output("n?", description="number")

    def outputs(u, true_value, false_value, y):
        for q in range(y.size):
            y[q] = true_value[q] if u[q] else false_value[q]


class Choose(Block):
    """One of two signals, as a truth value says.

    ::

        y = u_1 if condition else u_2
    """

    u_1 = Input("n?", description="signal while the condition is true")
    condition = Input(dtype=bool, unit="1", description="truth value")
    u_2 = Input("n?", description="signal while it is false")
    y = Output("n?", description="the chosen signal")

    def outputs(u_1, condition, u_2, y):
        for q in range(y.size):
            y[q] = u_1[q] if condition else u_2[q]


class Edge(Block):
    """Whether a truth value has become true, or false, since the last sample; sampled.

    ::

        rising[k] = u[k] and not u[k-1],   falling[k] = u[k-1] and not u[k]
    """

    u = Input("n?", dtype=bool, unit="1", description="truth value")
    last = State("n?", dtype=bool, start=False, description="that of the last sample")
    rising = Output("n?", dtype=bool, unit="1", description="whether it has become true")
    falling = Output("n?", dtype=bool, unit="1", description="whether it has become false")

    def outputs(u, last, rising, falling):
        for q in range(rising.size):
            rising[q] = u[q] and not last[q]
            falling[q] = last[q] and not u[q]

    def update(u, next_last):
        for q in range(u.size):
            next_last[q] = u[q]


class Latch(Block):
    """A truth value that is set, and stays until it is reset, which wins; sampled.

    ::

        y[k] = (set[k] or y[k-1]) and not reset[k]
    """

    set = Input("n?", dtype=bool, unit="1", description="makes it true")
    reset = Input("n?", dtype=bool, unit="1", start=False, description="makes it false")
    last = State("n?", dtype=bool, start=False, description="that of the last sample")
    y = Output("n?", dtype=bool, unit="1", description="truth value")

    def outputs(set, reset, last, y):  # noqa: A002  # as engineers call it
        for q in range(y.size):
            y[q] = (set[q] or last[q]) and not reset[q]

    def update(y, next_last):
        for q in range(y.size):
            next_last[q] = y[q]


class StateMachine(Block):
    """A machine of states from a table: which state follows which, for each combination of its conditions; sampled.

    ::

        state[k+1] = table[state[k], c[k]],   c = 1 + u_1 + 2 u_2 + 4 u_3 + …
        y[k] = values[state[k]]

    States and columns are counted from 1. It begins in state 1, unless `state` has another start value. A condition is
    a truth value; with one, the table has a column for false and one for true.
    """

    u = Input("conditions?", dtype=bool, unit="1", description="conditions")
    table = Parameter("states", "columns", dtype=np.int32, unit="1", description="next states, a row for each state")
    values = Parameter("states", description="output in each state")
    state = State(output=True, dtype=np.int32, start=1, unit="1", description="number of the state, from 1")
    y = Output(description="output")

    closed = rule("the table's numbers are from 1 to its rows")(
        lambda table: bool(np.all((table >= 1) & (table <= len(table))))
    )
    complete = rule("a column for each combination of conditions")(lambda columns, conditions: columns == 2**conditions)

    def outputs(values, state, y):
        y[0] = values[state - 1]

    def update(u, table, state, next_state):
        column, weight = 0, 1
        for k in range(u.size):
            if u[k]:
                column += weight
            weight *= 2
        next_state[0] = table[state - 1, column]
