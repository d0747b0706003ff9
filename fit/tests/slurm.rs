//! A library fitted by Slurm itself: three nodes on this machine, an array job of six workers, one of which is cancelled.

#[path = "fit_program/support.rs"]
mod support;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use support::{btf_fit, bumpy_capture_of, skip};

/// Ports of the controller and of the first node.
const PORTS: [u16; 2] = [16_917, 16_921];
const NODES: u16 = 3;
const MATERIALS: usize = 24;

/// A controller and nodes, which end when it is dropped.
struct Cluster {
    daemons: Vec<Child>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in &mut self.daemons {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

impl Cluster {
    /// Starts Slurm with everything below `folder`; `None` where it is not installed.
    fn start(folder: &Path) -> Option<Cluster> {
        let installed =
            |name: &str| Command::new(name).arg("-V").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
        if !["slurmctld", "slurmd", "sbatch"].into_iter().all(installed) {
            return None;
        }
        let host = Command::new("hostname").arg("-s").output().ok()?.stdout;
        let host = String::from_utf8_lossy(&host).trim().to_string();
        let shown = folder.display();
        let [controller, node] = PORTS;
        let last = node + NODES - 1;
        let settings = format!(
            "ClusterName=library\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controller}\nSlurmUser=root\nSlurmdUser=root\n\
             AuthType=auth/none\nCryptoType=crypto/none\nCredType=cred/none\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             SwitchType=switch/none\nMpiDefault=none\nReturnToService=2\nSelectType=select/cons_tres\nSelectTypeParameters=CR_Core\n\
             SlurmctldPidFile={shown}/controller.pid\nSlurmdPidFile={shown}/%n.pid\nSlurmdSpoolDir={shown}/%n\n\
             StateSaveLocation={shown}/state\nSlurmctldLogFile={shown}/controller.log\nSlurmdLogFile={shown}/%n.log\n\
             SlurmdParameters=config_overrides\n\
             NodeName=n[1-{NODES}] NodeHostname={host} NodeAddr=127.0.0.1 Port=[{node}-{last}] CPUs=2 RealMemory=8000\n\
             PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n"
        );
        fs::create_dir_all(folder.join("state")).unwrap();
        fs::write(folder.join("slurm.conf"), settings).unwrap();
        let daemon = |name: &str, arguments: &[&str]| {
            let mut command = slurm(name, folder);
            command.arg("-D").args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            command.spawn().expect("a daemon of Slurm starts")
        };
        let mut daemons = vec![daemon("slurmctld", &[])];
        for number in 1..=NODES {
            fs::create_dir_all(folder.join(format!("n{number}"))).unwrap();
            daemons.push(daemon("slurmd", &["-N", &format!("n{number}")]));
        }
        Some(Cluster { daemons })
    }
}

fn slurm(name: &str, folder: &Path) -> Command {
    let mut command = Command::new(name);
    command.env("SLURM_CONF", folder.join("slurm.conf")).current_dir(folder);
    command
}

fn told(command: &mut Command) -> String {
    command.output().map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default()
}

/// Waits until `done`, and fails with what Slurm says after two minutes.
fn wait(folder: &Path, what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        if start.elapsed() > Duration::from_secs(120) {
            let log = fs::read_to_string(folder.join("controller.log")).unwrap_or_default();
            panic!("{what} takes too long; {}\n{log}", told(slurm("squeue", folder).arg("-a")));
        }
        std::thread::sleep(Duration::from_millis(300));
    }
}

#[test]
fn an_array_job_fits_a_library_once() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some(_cluster) = Cluster::start(folder) else {
        skip("the test with Slurm: it is not installed (Debian: apt-get install slurm-wlm)");
        return;
    };
    for number in 0..MATERIALS {
        bumpy_capture_of(&folder.join("captures"), &format!("m{number:02}"), [6, 5], 4, number as u64 + 1);
    }
    let plan = ["library", "plan", "captures", "-o", "library.toml", "--bytes", "8kB"];
    let job = ["--slurm", "job.sh", "--workers", "6", "--worker-threads", "1", "--worker-memory", "1GB"];
    let output = btf_fit(&[&plan[..], &job].concat(), folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let idle = || told(slurm("sinfo", folder).args(["-h", "-t", "idle", "-o", "%D"])).trim() == "3";
    if !(0..100).any(|_| {
        idle() || {
            std::thread::sleep(Duration::from_millis(300));
            false
        }
    }) {
        let log = fs::read_to_string(folder.join("controller.log")).unwrap_or_default();
        skip(&format!(
            "the test with Slurm, whose nodes do not start here: {}",
            log.lines().last().unwrap_or("no log")
        ));
        return;
    }
    let submitted = told(slurm("sbatch", folder).args(["--parsable", "job.sh"]));
    let id = submitted.trim().to_string();
    assert!(id.parse::<u32>().is_ok(), "sbatch says {submitted:?}");
    let assets = || {
        let names = fs::read_dir(folder.join("assets")).into_iter().flatten().flatten();
        names.filter(|entry| entry.path().extension().is_some_and(|extension| extension == "spmm")).count()
    };
    wait(folder, "the first fit", || assets() > 0);
    // One worker is cancelled: it gives its material back, or the others have finished before.
    let _ = slurm("scancel", folder).arg(format!("{id}_2")).status();
    wait(folder, "the job", || told(slurm("squeue", folder).arg("-h")).trim().is_empty());
    // A job may be submitted again at any time.
    let again = told(slurm("sbatch", folder).args(["--parsable", "job.sh"]));
    assert!(again.trim().parse::<u32>().is_ok(), "{again:?}");
    wait(folder, "the second job", || told(slurm("squeue", folder).arg("-h")).trim().is_empty());
    assert_eq!(assets(), MATERIALS);
    let collected = btf_fit(&["library", "collect", "library.toml"], folder);
    let text = String::from_utf8_lossy(&collected.stdout).into_owned();
    assert!(text.contains("24 fitted") && !text.contains(','), "{text}");
}
