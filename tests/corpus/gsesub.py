"""A GSESUB as documented: a mass on a spring in states of its own, and a controller of a body."""


def GSESUB(id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutput):
    stated, output = nstate * [0.0], noutput * [0.0]
    k, c = par
    stated[0] = states[1]
    stated[1] = -k * states[0] - c * states[1] + input[0]
    output[0] = 2.0 * states[0]
    output[1] = -50.0 * input[1] - 4.0 * input[2]
    return [stated, output]
