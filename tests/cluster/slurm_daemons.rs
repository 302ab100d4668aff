//! A Slurm of this machine alone: its controller and two nodes, with ports and files of their own. Nothing of the system is changed.

use crate::rig::{program_of_system, succeeded};
use std::collections::HashMap;
use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Longer than Slurm takes for anything here on a slow machine.
const HANGS: Duration = Duration::from_secs(300);

/// The greatest number of an element of an array here is 3, so that few tasks already need several arrays.
pub(crate) const MAX_ARRAY_SIZE: u32 = 4;

pub(crate) struct Slurm {
    folder: TempDir,
    /// In the order in which they start; they end in the reverse order.
    daemons: Vec<Child>,
}

impl Slurm {
    /// Starts it. `None` if it is not installed.
    pub(crate) fn start() -> Option<Slurm> {
        let names = ["munged", "slurmctld", "slurmd", "sbatch"];
        let programs: HashMap<&str, PathBuf> =
            names.into_iter().map(|name| Some((name, program_of_system(name)?))).collect::<Option<_>>()?;
        let folder = tempfile::tempdir().unwrap();
        // munged wants that everybody can come to its socket.
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let mut slurm = Slurm { folder, daemons: Vec::new() };
        slurm.write_files();
        let path = |name: &str| slurm.folder.path().join(name).to_str().unwrap().to_owned();
        let mut munged = Command::new(&programs["munged"]);
        munged.arg("--foreground").arg("--num-threads=1");
        for (option, file) in
            [("socket", "socket"), ("key-file", "key"), ("pid-file", "munged.pid"), ("seed-file", "munged.seed")]
        {
            munged.arg(format!("--{option}={}", path(file)));
        }
        munged.arg(format!("--log-file={}", path("munged.log")));
        let socket = slurm.folder.path().join("socket");
        slurm.run(munged);
        slurm.wait_until("munged", |_| socket.exists());
        let conf = slurm.conf();
        let mut controller = Command::new(&programs["slurmctld"]);
        controller.args(["-D", "-c", "-f"]).arg(&conf);
        slurm.run(controller);
        for node in ["n1", "n2"] {
            let mut daemon = Command::new(&programs["slurmd"]);
            daemon.args(["-D", "-N", node, "-f"]).arg(&conf);
            slurm.run(daemon);
        }
        slurm.wait_until("the nodes", |slurm| {
            let nodes = slurm.command("sinfo").args(["--noheader", "--format=%D %t"]).output().unwrap();
            String::from_utf8_lossy(&nodes.stdout).trim() == "2 idle"
        });
        Some(slurm)
    }

    fn conf(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }

    fn write_files(&self) {
        let folder = self.folder.path();
        // Whoever reads it may send jobs to these daemons, which go with the test.
        let mut key = [0; 128];
        std::io::Read::read_exact(&mut fs::File::open("/dev/urandom").unwrap(), &mut key).unwrap();
        fs::write(folder.join("key"), key).unwrap();
        fs::set_permissions(folder.join("key"), fs::Permissions::from_mode(0o400)).unwrap();
        for name in ["state", "spool.n1", "spool.n2"] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        let host = host.trim().split('.').next().unwrap();
        let user = succeeded(Command::new("id").arg("-un").output().unwrap());
        let listeners: Vec<TcpListener> = (0..3).map(|_| TcpListener::bind(("127.0.0.1", 0)).unwrap()).collect();
        let port = |at: usize| listeners[at].local_addr().unwrap().port();
        let at = folder.display();
        let text = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser={0}\nSlurmdUser={0}\n\
             AuthType=auth/munge\nAuthInfo=socket={at}/socket\nCredType=cred/munge\n\
             SlurmctldPort={1}\nSlurmctldPidFile={at}/slurmctld.pid\nSlurmctldLogFile={at}/slurmctld.log\n\
             StateSaveLocation={at}/state\nSlurmdSpoolDir={at}/spool.%n\nSlurmdPidFile={at}/slurmd.%n.pid\n\
             SlurmdLogFile={at}/slurmd.%n.log\nSlurmdParameters=config_overrides\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nSwitchType=switch/none\nMpiDefault=none\n\
             AccountingStorageType=accounting_storage/none\nJobAcctGatherType=jobacct_gather/none\n\
             MaxArraySize={MAX_ARRAY_SIZE}\nKillWait=30\nSchedulerParameters=batch_sched_delay=0,sched_interval=1\n\
             PropagateResourceLimits=NONE\nReturnToService=2\n\
             NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={2} CPUs=2 RealMemory=2000\n\
             NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={3} CPUs=2 RealMemory=2000\n\
             PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP\n",
            user.trim(),
            port(0),
            port(1),
            port(2)
        );
        fs::write(self.conf(), text).unwrap();
    }

    /// Starts a daemon.
    fn run(&mut self, mut command: Command) {
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        self.daemons.push(command.spawn().unwrap());
    }

    /// Returns a command that speaks to these daemons.
    pub(crate) fn command(&self, program: &str) -> Command {
        self.with_conf(Command::new(program))
    }

    /// Makes a command speak to these daemons.
    pub(crate) fn with_conf(&self, mut command: Command) -> Command {
        command.env("SLURM_CONF", self.conf());
        command
    }

    /// Returns a line for each task that waits or runs, with the fields of `format`.
    pub(crate) fn queue(&self, format: &str) -> Vec<String> {
        let queue = self.command("squeue").args(["--noheader", "--array", "--format", format]).output().unwrap();
        succeeded(queue).lines().map(|line| line.trim().to_owned()).collect()
    }

    /// Waits until all tasks have ended.
    pub(crate) fn wait(&self) {
        self.wait_until("the tasks", |slurm| slurm.queue("%i").is_empty());
    }

    #[track_caller]
    pub(crate) fn wait_until(&self, what: &str, holds: impl Fn(&Slurm) -> bool) {
        let start = Instant::now();
        while !holds(self) {
            assert!(start.elapsed() < HANGS, "waiting for {what}: {}", self.logs());
            sleep(Duration::from_millis(20));
        }
    }

    /// Returns what the daemons have written.
    pub(crate) fn logs(&self) -> String {
        let files = fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let logs = files.filter(|path| path.extension().is_some_and(|ending| ending == "log"));
        logs.map(|path| format!("\n{}:\n{}", path.display(), fs::read_to_string(&path).unwrap_or_default())).collect()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        if self.daemons.len() > 1 {
            // What still runs after a failed test.
            let numbers = self.command("squeue").args(["--noheader", "--format=%i"]).output().map(|o| o.stdout);
            let numbers = String::from_utf8_lossy(&numbers.unwrap_or_default()).into_owned();
            if !numbers.trim().is_empty() {
                let _ = self.command("scancel").args(["--signal=KILL", "--full"]).args(numbers.lines()).status();
                let _ = self.command("scancel").args(numbers.lines()).status();
                sleep(Duration::from_secs(1));
            }
        }
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let _ = daemon.wait();
        }
    }
}
