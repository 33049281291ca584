"""A slip controller in Python (docs/python.md): a constant torque and a gain times the slip error."""


class Proportional:
    def reset(self, input):
        pass

    def step(self, input):
        """Returns the wanted brake torque in N m."""
        return 4.0 + 60.0 * (input.slip_ref - input.slip)
