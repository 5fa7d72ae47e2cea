#!/usr/bin/env python3
"""Two seconds of rotorpy's Crazyflie under a fixed row of motor commands, for tests/rotorpy.rs.

    python3 -m venv venv && venv/bin/pip install rotorpy==3.0.0
    venv/bin/python rotorpy_flight.py > rotorpy_crazyflie.csv

A row every 20 ms: four commanded rotor speeds held until the next row (rad/s), then the state at the row's time: position (m),
velocity (m/s), attitude (x, y, z, w), body rates (rad/s). Rotor lag and rotor drag are on, ground effects off, and the integrator is
told to be far more exact than the comparison.
"""
import math

import numpy as np
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor

HOVER = math.sqrt(quad_params["mass"] * 9.81 / (4 * quad_params["k_eta"]))


def command(t):
    """Climb and fall, doublets of roll and pitch, and a turn."""
    climb = 90.0 * math.sin(2.5 * t)
    roll = 14.0 * math.sin(4 * math.pi * t) if t < 1.0 else -14.0 * math.sin(4 * math.pi * t)
    pitch = 6.0 * math.sin(2 * math.pi * (t - 0.3)) if 0.3 <= t < 1.3 else 0.0
    yaw = 30.0 if 0.5 <= t < 0.9 else -20.0 if 1.2 <= t < 1.8 else 0.0
    # Rotors: front left, front right, back right, back left.
    return np.array([HOVER + climb + s[0] * roll + s[1] * pitch + s[2] * yaw
                     for s in ((1, -1, 1), (-1, -1, -1), (-1, 1, 1), (1, 1, -1))])


def main():
    state = {"x": np.zeros(3), "v": np.zeros(3), "q": np.array([0.0, 0, 0, 1]), "w": np.zeros(3),
             "wind": np.zeros(3), "rotor_speeds": np.full(4, HOVER)}
    vehicle = Multirotor(quad_params, state, control_abstraction="cmd_motor_speeds", aero=True, enable_ground=False,
                         integrator_kwargs={"method": "DOP853", "rtol": 1e-11, "atol": 1e-13})
    for k in range(101):
        speeds = command(0.02 * k)
        row = [*np.round(speeds, 3), *state["x"], *state["v"], *state["q"], *state["w"]]
        print(",".join("%.9g" % value for value in row))
        state = vehicle.step(state, {"cmd_motor_speeds": np.round(speeds, 3)}, 0.02)


if __name__ == "__main__":
    main()
