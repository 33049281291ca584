"""A plant FMU and a controller FMU in FMPy, exchanged at every control period."""
import shutil

import fmpy
import fmpy.fmi2
import fmpy.fmi3


class Instance:
    """An instance of an FMU of either version; values by the variables' names."""

    def __init__(self, path, name='instance', **parameters):
        self.description = fmpy.read_model_description(path)
        self.folder = fmpy.extract(path)
        self.messages = []
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.types = {v.name: v.type for v in self.description.modelVariables}
        self.version = int(self.description.fmiVersion[0])
        module = fmpy.fmi2.FMU2Slave if self.version == 2 else fmpy.fmi3.FMU3Slave
        guid = self.description.guid  # FMPy calls the token of FMI 3 so too
        self.fmu = module(guid=guid, unzipDirectory=self.folder, instanceName=name,
                          modelIdentifier=self.description.coSimulation.modelIdentifier)
        self.fmu.instantiate()
        for key, value in parameters.items():
            self.set(key.replace('__', '.'), value)
        if self.version == 2:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _call(self, action, name):
        kind = self.types[name] if self.types[name] != 'Float64' or self.version == 3 else 'Real'
        return getattr(self.fmu, action + kind)

    def get(self, name):
        return self._call('get', name)([self.references[name]])[0]

    def set(self, name, value):
        self._call('set', name)([self.references[name]], [value])

    def step(self, time_s, step_s):
        self.fmu.doStep(currentCommunicationPoint=time_s, communicationStepSize=step_s)


def stop(plant, controller, *, ideal_sensors, step_s=1e-3, end_speed_m_s=0.3):
    """(time s, distance m, car speeds) from 170 rad/s until the car is slower than `end_speed_m_s`."""
    distance_m, n, speeds = 0.0, 0, [plant.get('car_speed_m_s')]
    while speeds[-1] >= end_speed_m_s:
        for name in ('upper_counts', 'lower_counts') if not ideal_sensors else ('omega1_rad_s', 'omega2_rad_s'):
            controller.set(name, plant.get(name))
        controller.step(n * step_s, step_s)
        for name in ('brake_duty', 'brake_torque_ref_Nm'):
            plant.set(name, controller.get(name))
        plant.step(n * step_s, step_s)
        n += 1
        speeds.append(plant.get('car_speed_m_s'))
        distance_m += 0.5 * (speeds[-2] + speeds[-1]) * step_s
    return n * step_s, distance_m, speeds
