"""Learning to brake: gymnasium environments over the program's own cycle (docs/learning.md).

    import gymnasium, abs_hil.learning
    environment = gymnasium.make("abs_hil/SlipControl-v0")
"""
import contextlib

from .rigs import Rigs, Task

ID = 'abs_hil/SlipControl-v0'
#: a rig in real time
RIG_ID = 'abs_hil/RigSlipControl-v0'
__all__ = ['ID', 'RIG_ID', 'Rigs', 'Task', 'register']


def register() -> None:
    """Makes the environment known to gymnasium. `import abs_hil.learning` does so if gymnasium is installed."""
    import gymnasium
    if ID not in gymnasium.registry:
        gymnasium.register(ID, entry_point='abs_hil.learning.environment:SlipControl',
                           vector_entry_point='abs_hil.learning.environment:SlipControlVector')
    if RIG_ID not in gymnasium.registry:
        gymnasium.register(RIG_ID, entry_point='abs_hil.learning.rig_environment:RigSlipControl')


with contextlib.suppress(ImportError):  # training in NumPy alone needs no gymnasium
    register()
