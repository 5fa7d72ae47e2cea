//! What a flight controller does with a set-point: attitude and thrust, then rotor speeds. PX4 has its own; a simulated airframe
//! uses this one, on the state that an estimator would give it.
