"""A Slurm of one machine under a folder of its own, which listens on the loopback alone.

munged, slurmctld and slurmd are started in the foreground and ended by their process ids.
"""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = ["munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "sinfo", "ss"]
SECONDS = 60  # for a daemon to answer

# A requeued job waits until the credentials of before have expired, 120 s by default.
CONFIGURATION = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket,cred_expire=5
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
JobRequeue=1
CompleteWait=0
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=1000,bf_interval=1
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory=1000
PartitionName=debug Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """What is not here to start one; empty if all is."""
    if os.getuid() != 0:
        return "it is started as root"
    path = os.environ["PATH"] + ":/usr/sbin:/sbin"
    lacking = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    return f"no program {', '.join(lacking)}; Debian: slurm-wlm munge iproute2" if lacking else ""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Cluster:
    def __init__(self, folder, cores=2):
        self.folder = pathlib.Path(folder)
        self.cores = cores
        self.daemons = {}

    def __enter__(self):
        os.environ["PATH"] += ":/usr/sbin:/sbin"
        for name in ("munge", "state", "spool"):
            (self.folder / name).mkdir(mode=0o700)
        key = self.folder / "munge" / "key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        ports = free_ports(2)
        configuration = self.folder / "slurm.conf"
        configuration.write_text(CONFIGURATION.format(
            host=socket.gethostname().split(".")[0], folder=self.folder, cores=self.cores,
            controller_port=ports[0], node_port=ports[1]))
        os.environ["SLURM_CONF"] = str(configuration)
        try:
            munge = self.folder / "munge"
            self.start("munged", "--force", "--foreground", f"--socket={munge}/socket",
                       f"--key-file={key}", f"--pid-file={munge}/pid", f"--log-file={munge}/log",
                       f"--seed-file={munge}/seed")
            self.wait("munged", lambda: (munge / "socket").exists())
            self.start("slurmctld", "-D")
            self.start("slurmd", "-D")
            self.wait("a node", lambda: "idle" in self.ask("sinfo", "--noheader", "--format=%T"))
            self.check_loopback()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_):
        self.stop()

    def start(self, name, *arguments):
        log = open(self.folder / f"{name}.out", "wb")
        self.daemons[name] = subprocess.Popen([name, *arguments], stdin=subprocess.DEVNULL,
                                              stdout=log, stderr=subprocess.STDOUT)

    def wait(self, what, ready):
        end = time.monotonic() + SECONDS
        while not ready():
            for name, daemon in self.daemons.items():
                if daemon.poll() is not None:
                    said = (self.folder / f"{name}.out").read_text(errors="replace")
                    raise RuntimeError(f"{name} ended with {daemon.returncode}: {said}")
            if time.monotonic() > end:
                raise RuntimeError(f"{what} is not there after {SECONDS} s")
            time.sleep(0.1)

    def ask(self, *words):
        return subprocess.run(words, capture_output=True, text=True).stdout

    def lose_node(self, processes):
        """As a power cut: its daemon and these processes are gone at once. Then it is there again."""
        for pid in [self.daemons["slurmd"].pid, *processes]:
            os.kill(pid, signal.SIGKILL)
        self.daemons.pop("slurmd").wait()
        host = socket.gethostname().split(".")[0]
        self.ask("scontrol", "update", f"nodename={host}", "state=down", "reason=lost")
        self.wait("a lost node", lambda: "down" in self.ask("sinfo", "--noheader", "--format=%T"))
        self.start("slurmd", "-D")
        self.ask("scontrol", "update", f"nodename={host}", "state=resume")
        self.wait("a node", lambda: "down" not in self.ask("sinfo", "--noheader", "--format=%T"))

    def check_loopback(self):
        own = {f"pid={daemon.pid}," for daemon in self.daemons.values()}
        lines = [line for line in self.ask("ss", "-ltnpH").splitlines()
                 if any(pid in line for pid in own)]
        if len(lines) < 2:
            raise RuntimeError(f"expected two daemons that listen, found {lines}")
        for line in lines:
            if not line.split()[3].startswith("127.0.0.1:"):
                raise RuntimeError(f"a daemon listens beyond the loopback: {line}")
        print("\n".join(lines))

    def stop(self):
        for name in reversed(list(self.daemons)):
            daemon = self.daemons[name]
            if daemon.poll() is None:
                daemon.send_signal(signal.SIGTERM)
            try:
                daemon.wait(30)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
