//! A real Slurm on this machine, of Debian's packages: controller, node and munge in a folder of their own.
//!
//! The machine has neither systemd nor control groups for it, so processes are tracked by their parents, and key,
//! sockets and state are named by hand. It needs root, as `slurmd` does.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::fleet::{Tree, until};
use super::folder;
use tempfile::TempDir;

/// A Slurm of one node with two cores.
pub struct Slurm {
    dir: TempDir,
    /// Ended in this order.
    _daemons: [Tree; 3],
}

impl Slurm {
    pub fn start() -> Self {
        let here = |name: &str| {
            let path = ["/usr/sbin", "/usr/bin"].map(|dir| Path::new(dir).join(name)).into_iter().find(|p| p.exists());
            path.unwrap_or_else(|| panic!("{name} is not installed for the tests: run tests/python/setup.sh all"))
        };
        let dir = folder();
        let file = |name: &str| dir.path().join(name);
        ["state", "spool"].iter().for_each(|name| std::fs::create_dir(file(name)).expect("made"));
        std::fs::write(file("slurm.conf"), configuration(dir.path())).expect("written");
        let key: Vec<u8> = (0..1024u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        std::fs::write(file("key"), key).expect("written");
        let private = Command::new("chmod").args(["400"]).arg(file("key")).status().expect("chmod starts");
        assert!(private.success());
        let start = |command: &mut Command, name: &str| {
            let log = std::fs::File::create(file(name)).expect("a log");
            command.env("SLURM_CONF", file("slurm.conf")).stdin(Stdio::null());
            Tree::start(command.stdout(log.try_clone().expect("a log")).stderr(log))
        };
        let option = |name: &str, value: &str| format!("--{name}={}", file(value).display());
        let mut munge = Command::new(here("munged"));
        munge.args(["--foreground", "--force"]).args([option("key-file", "key"), option("socket", "munge.socket")]);
        munge.args([option("pid-file", "munge.pid"), option("log-file", "munge.log"), option("seed-file", "seed")]);
        let munge = start(&mut munge, "munge.out");
        until("munge is ready", Duration::from_secs(20), || file("munge.socket").exists());
        let controller = start(Command::new(here("slurmctld")).arg("-D"), "controller.log");
        let node = start(Command::new(here("slurmd")).args(["-D", "-N", &host()]), "node.log");
        let slurm = Self { _daemons: [node, controller, munge], dir };
        let is_idle = || {
            let state = slurm.command("sinfo").args(["-h", "-o", "%T"]).output().expect("sinfo starts");
            String::from_utf8_lossy(&state.stdout).trim() == "idle"
        };
        until("the node of Slurm is idle (is this root?)", Duration::from_secs(60), is_idle);
        slurm
    }

    /// A command that speaks to this Slurm.
    pub fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.dir.path().join("slurm.conf"));
        command
    }
}

fn host() -> String {
    std::fs::read_to_string("/proc/sys/kernel/hostname").expect("Linux").trim().to_owned()
}

fn configuration(dir: &Path) -> String {
    let port = || TcpListener::bind(("127.0.0.1", 0)).and_then(|l| l.local_addr()).expect("a free port").port();
    let (host, dir, [controller, node]) = (host(), dir.display(), [port(), port()]);
    format!(
        "ClusterName=fleet\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser=root\n\
         SlurmctldPort={controller}\nSlurmdPort={node}\n\
         AuthType=auth/munge\nCredType=cred/munge\nAuthInfo=socket={dir}/munge.socket\n\
         ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSwitchType=switch/none\nMpiDefault=none\n\
         SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU_Memory\nReturnToService=2\n\
         SchedulerParameters=sched_interval=1,batch_sched_delay=0\n\
         StateSaveLocation={dir}/state\nSlurmdSpoolDir={dir}/spool\n\
         SlurmctldPidFile={dir}/controller.pid\nSlurmdPidFile={dir}/node.pid\n\
         NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000 State=UNKNOWN\n\
         PartitionName=all Nodes={host} Default=YES State=UP\n"
    )
}
