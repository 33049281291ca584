"""A law in Python, which PythonFMU exports as an FMU: foreign_fmu_test.py."""
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class ProportionalLaw(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.lam = 0.0
        self.Tb = 0.0
        self.wanted = 0.1
        self.register_variable(Real('lam', causality=Fmi2Causality.input))
        self.register_variable(Real('Tb', causality=Fmi2Causality.output))
        self.register_variable(Real('wanted', causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))

    def do_step(self, current_time, step_size):
        self.Tb = max(0.0, 2.0 + 10.0 * (self.wanted - self.lam))
        return True
