"""Learn a robot arm's inverse dynamics from data and serve it as feedforward torques and energies."""
