"""Learn a robot arm's inverse dynamics from data; serve feedforward torques and energies."""
