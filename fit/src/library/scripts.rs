//! Scripts that run a plan's workers: array jobs for Slurm, jobs for OpenCue, and one shell command a line.

use std::fmt::Write;
use std::path::Path;

/// A script that runs a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheduler {
    /// An array job for `sbatch`.
    Slurm,
    /// A Python script that submits a job with OpenCue's outline.
    OpenCue,
    /// One shell command a line, as for GNU parallel.
    Shell,
}

/// What a worker of a script may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkerLimits {
    /// Number of workers.
    pub workers: usize,
    /// Threads of each.
    pub threads: usize,
    /// Memory of each, bytes.
    pub memory_bytes: u64,
}

impl WorkerLimits {
    /// Returns the memory that a fit plans for itself, bytes; the rest is for what it does not count, such as the program.
    pub fn fit_bytes(&self) -> u64 {
        self.memory_bytes / 4 * 3
    }
}

/// Returns the script with which `scheduler` runs the plan at `plan` by the program `program`. Every worker fits what is not
/// yet done, so a script may be submitted again at any time.
pub fn library_script(scheduler: Scheduler, plan: &Path, program: &Path, limits: WorkerLimits) -> String {
    let WorkerLimits { workers, threads, memory_bytes } = limits;
    let [program, plan] = [program, plan].map(|path| path.display().to_string());
    let megabytes = limits.fit_bytes().div_ceil(1_000_000);
    let command = |shard: &str| {
        let [program, plan] = [&program, &plan].map(|path| shell_word(path));
        format!(
            "{program} library run {plan} --shard {shard}/{workers} --threads {threads} --memory {megabytes}MB --quiet"
        )
    };
    match scheduler {
        Scheduler::Slurm => {
            let megabytes = memory_bytes.div_ceil(1_000_000);
            format!(
                "#!/bin/sh\n#SBATCH --job-name=btf-library\n#SBATCH --array=1-{workers}\n#SBATCH --cpus-per-task={threads}\n\
                 #SBATCH --mem={megabytes}M\n#SBATCH --requeue\n#SBATCH --signal=B:TERM@60\n\
                 # A worker that is stopped gives its material back; one that is killed loses it to another after a while.\n\
                 exec {}\n",
                command("\"$SLURM_ARRAY_TASK_ID\"")
            )
        }
        Scheduler::OpenCue => {
            let arguments = ["library", "run"].map(|word| format!("{word:?}")).join(", ");
            format!(
                "\"\"\"Submits the workers of a library to OpenCue: python3 THIS_FILE\"\"\"\n\n\
                 import outline\nimport outline.cuerun\nimport outline.modules.shell\n\n\
                 job = outline.Outline(\"btf-library\", shot=\"library\", show=\"testing\")\n\
                 # One frame for each worker; #IFRAME# is its number.\n\
                 layer = outline.modules.shell.Shell(\n    \"fit\",\n    command=[{}, {arguments}, {}, \"--shard\", \"#IFRAME#/{workers}\", \"--threads\", \"{threads}\", \"--memory\", \"{megabytes}MB\", \"--quiet\"],\n    \
                 range=\"1-{workers}\",\n    threads={threads},\n    memory={:?},\n)\n\
                 job.add_layer(layer)\noutline.cuerun.launch(job, use_pycuerun=False)\n",
                python_text(&program),
                python_text(&plan),
                format!("{}m", memory_bytes.div_ceil(1_000_000)),
            )
        }
        Scheduler::Shell => (1..=workers).fold(String::new(), |mut lines, shard| {
            // Writing to a string cannot fail.
            let _ = writeln!(lines, "{}", command(&shard.to_string()));
            lines
        }),
    }
}

/// Returns `text` as one word of a shell.
fn shell_word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+:,@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) { text.into() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// Returns `text` as a literal of Python.
fn python_text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', r"\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: WorkerLimits = WorkerLimits { workers: 3, threads: 2, memory_bytes: 4_000_000_000 };

    fn script(scheduler: Scheduler, plan: &str) -> String {
        library_script(scheduler, Path::new(plan), Path::new("/opt/btf-fit"), LIMITS)
    }

    #[test]
    fn every_worker_has_its_share_and_its_limits() {
        let lines = script(Scheduler::Shell, "/a/plan.toml");
        assert_eq!(
            lines.lines().nth(1).unwrap(),
            "/opt/btf-fit library run /a/plan.toml --shard 2/3 --threads 2 --memory 3000MB --quiet"
        );
        assert_eq!(lines.lines().count(), 3);
        let slurm = script(Scheduler::Slurm, "/a/plan.toml");
        for line in ["#SBATCH --array=1-3", "#SBATCH --cpus-per-task=2", "#SBATCH --mem=4000M"] {
            assert!(slurm.lines().any(|found| found == line), "{line} in {slurm}");
        }
        assert!(slurm.ends_with("--shard \"$SLURM_ARRAY_TASK_ID\"/3 --threads 2 --memory 3000MB --quiet\n"), "{slurm}");
        let cue = script(Scheduler::OpenCue, "/a/plan.toml");
        assert!(cue.contains("range=\"1-3\"") && cue.contains("\"#IFRAME#/3\""), "{cue}");
    }

    #[test]
    fn odd_paths_stay_one_word() {
        assert!(script(Scheduler::Shell, "/a/my plan's.toml").contains(r"'/a/my plan'\''s.toml'"));
        assert_eq!(shell_word("/a/b-1.toml"), "/a/b-1.toml");
        assert_eq!(shell_word("a;b"), "'a;b'");
    }
}
