"""A real Slurm of several nodes on this computer, for tests. To be used inside `unshare --net --pid --fork --mount-proc
--kill-child`: its network reaches nobody, and its processes end with the namespace."""
import os
import pathlib
import pwd
import shutil
import subprocess
import time

ADDRESS = '10.99.0.1'  # slurm's look-up of names wants an address besides loopback
PROGRAMS = ('slurmctld', 'slurmd', 'sbatch', 'squeue', 'scancel', 'scontrol', 'munged')

CONFIGURATION = '''ClusterName=test
SlurmctldHost={host}({address})
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmctldPidFile={folder}/slurmctld.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdSpoolDir={folder}/spool-%n
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MpiDefault=none
SwitchType=switch/none
SlurmctldTimeout=30
SlurmdTimeout=300
KillWait=2
MinJobAge=3600
SchedulerParameters=sched_interval=2,sched_min_interval=100000,bf_interval=2,batch_sched_delay=1
{nodes}
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
'''


def missing():
    """What a cluster lacks here; empty if nothing."""
    absent = [name for name in PROGRAMS if not shutil.which(name, path=os.environ['PATH'] + ':/usr/sbin')]
    if absent:
        return f'{", ".join(absent)} not installed (scripts/setup.sh packages-slurm.txt)'
    return '' if os.geteuid() == 0 else 'needs root'


class Cluster:
    def __init__(self, folder, nodes):
        self.folder = pathlib.Path(folder)
        self.nodes = [f'n{number}' for number in range(1, nodes + 1)]
        self.slurmd = {}
        self.environment = dict(os.environ, SLURM_CONF=str(self.folder / 'slurm.conf'),
                                PATH=os.environ['PATH'] + ':/usr/sbin')

    def start(self):
        for words in ('link set lo up', 'link add d0 type veth peer name d1', f'addr add {ADDRESS}/24 dev d0',
                      'link set d0 up', 'link set d1 up'):
            subprocess.run(['ip', *words.split()], check=True)
        self._start_munge()
        host = os.uname().nodename.split('.')[0]
        nodes = '\n'.join(f'NodeName={node} NodeHostname={host} NodeAddr={ADDRESS} Port={17001 + number} CPUs=1 RealMemory=500'
                          for number, node in enumerate(self.nodes))
        (self.folder / 'state').mkdir()
        (self.folder / 'slurm.conf').write_text(
            CONFIGURATION.format(host=host, address=ADDRESS, folder=self.folder, nodes=nodes))
        self._background('slurmctld', '-D', '-c')
        for node in self.nodes:
            (self.folder / f'spool-{node}').mkdir()
            self.start_node(node)
        self.wait(lambda: all('idle' in self.state(node) for node in self.nodes), 'all nodes are idle')

    def _start_munge(self):
        home = self.folder / 'munge'
        home.mkdir(mode=0o755)
        (home / 'key').write_bytes(os.urandom(1024))
        user = pwd.getpwnam('munge')
        for path in (home, home / 'key'):
            os.chown(path, user.pw_uid, user.pw_gid)
        (home / 'key').chmod(0o400)
        self._background('runuser', '-u', 'munge', '--', '/usr/sbin/munged', '--foreground', '--force',
                         *(f'--{what}={home}/{name}' for what, name in (
                             ('key-file', 'key'), ('socket', 'socket'), ('pid-file', 'pid'), ('log-file', 'log'),
                             ('seed-file', 'seed'))))
        self.wait((home / 'socket').exists, 'munge listens')

    def _background(self, *words):
        return subprocess.Popen(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL)

    def start_node(self, node):
        self.slurmd[node] = self._background('slurmd', '-D', '-N', node)

    def lose_node(self, node):
        """The node's daemon is gone, and the controller knows. What ran there goes on until somebody kills it."""
        self.slurmd[node].kill()
        self.slurmd[node].wait()
        self.run('scontrol', 'update', f'nodename={node}', 'state=down', 'reason=test')

    def bring_back(self, node):
        self.start_node(node)
        self.run('scontrol', 'update', f'nodename={node}', 'state=resume')

    def run(self, *words, check=True):
        done = subprocess.run(words, env=self.environment, capture_output=True, text=True)
        if check and done.returncode != 0:
            raise AssertionError(f'{words}: status {done.returncode}: {done.stdout}{done.stderr}')
        return done

    def state(self, node):
        done = self.run('sinfo', '--noheader', f'--nodes={node}', '--format=%T', check=False)
        return done.stdout.strip()

    def jobs(self, states='all'):
        """(task, state, node) of each job and task."""
        done = self.run('squeue', '--noheader', '--array', f'--states={states}', '--format=%i %T %N')
        return [tuple((line + ' ').split(' ')[:3]) for line in done.stdout.splitlines()]

    def active(self):
        return self.jobs('PENDING,CONFIGURING,RUNNING,COMPLETING,SUSPENDED')

    @staticmethod
    def wait(holds, what, seconds=180):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := holds():
                return found
            time.sleep(0.1)
        raise AssertionError(f'not within {seconds} s: {what}')
