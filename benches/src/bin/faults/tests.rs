//! Tests, each in a process of its own: which faults it reaches, how long it takes, whether it fails with a fault.

use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::any_error::AnyError;
use crate::arguments::Arguments;
use crate::fault::Fault;
use crate::memory::Memory;
use crate::outcome::Outcome;
use crate::test_program::{Program, Test};

/// What a test with a fault may take: that many times what it takes without, and some seconds for a machine that is busy.
const PATIENCE: (u32, Duration) = (10, Duration::from_secs(20));
/// Memory of its own that a test may take, in KiB: a fault may ask for all there is.
const MEMORY_KIB: usize = 4 << 20;

impl Program {
    /// Its tests but the ignored ones.
    fn tests(&self) -> Result<Vec<String>, AnyError> {
        let list = |words: &[&str]| -> Result<BTreeSet<String>, AnyError> {
            let done = Command::new(&self.path).args(words).current_dir(&self.folder).output()?;
            let text = String::from_utf8(done.stdout)?;
            Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
        };
        let ignored = list(&["--list", "--format", "terse", "--ignored"])?;
        Ok(list(&["--list", "--format", "terse"])?.difference(&ignored).cloned().collect())
    }

    /// Whether a test passes within a time; a test that hangs does not.
    fn passes(&self, test: &str, variable: (&str, &str), limit: Duration) -> Result<bool, AnyError> {
        let limited = format!("ulimit -d {MEMORY_KIB}; exec nice -n 5 \"$0\" --exact \"$1\" --test-threads 1");
        let mut child = Command::new("sh")
            .args(["-c", &limited])
            .arg(&self.path)
            .arg(test)
            .env(variable.0, variable.1)
            .env("CARGO_MANIFEST_DIR", &self.folder)
            .current_dir(&self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()?;
        let begin = Instant::now();
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status.success());
            }
            if begin.elapsed() > limit {
                // The test and all that it started.
                Command::new("kill").args(["-9", "--", &format!("-{}", child.id())]).status()?;
                child.wait()?;
                return Ok(false);
            }
            std::thread::sleep(Duration::from_millis(if begin.elapsed().as_millis() < 200 { 2 } else { 20 }));
        }
    }
}

/// Does something for each of many, `jobs` at a time; results in order.
fn at_a_time<T: Sync, R: Send>(all: &[T], jobs: usize, each: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let (next, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            scope.spawn(|| {
                while let Some((index, one)) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, all.get(i)?)))
                {
                    let result = each(one);
                    results.lock().unwrap_or_else(std::sync::PoisonError::into_inner).insert(index, result);
                }
            });
        }
    });
    results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).into_values().collect()
}

/// Runs every test once without a fault. Those that fail are named and left out: the copy is not the workspace to the letter.
pub(crate) fn record(
    programs: &[Program],
    file: &Path,
    arguments: &Arguments,
    memory: &mut Memory,
) -> Result<Vec<Test>, AnyError> {
    let (mut tests, mut all) = (Vec::new(), Vec::new());
    for program in programs {
        match memory.recorded(&program.path) {
            Some(known) => tests.extend(known.iter().cloned()),
            None => all.extend(program.tests()?.into_iter().map(|name| (program, name))),
        }
    }
    let numbered: Vec<_> = all.into_iter().enumerate().collect();
    let recorded = at_a_time(&numbered, arguments.jobs, |(index, (program, name))| -> Result<Option<Test>, AnyError> {
        let file = file.with_extension(index.to_string());
        let begin = Instant::now();
        let passes = program.passes(
            name,
            ("PLANTED_REACHED", &file.to_string_lossy()),
            Duration::from_secs_f64(arguments.longest),
        )?;
        let time = begin.elapsed();
        let noted = std::fs::read_to_string(&file).unwrap_or_default();
        let _ = std::fs::remove_file(&file);
        let reaches = noted.lines().filter_map(|line| line.parse().ok()).collect();
        if !passes {
            eprintln!("fails without a fault or takes too long, left out: {} {name}", program.krate);
        }
        Ok(passes.then(|| Test { program: (*program).clone(), name: name.clone(), time, reaches }))
    });
    let recorded: Vec<Test> = recorded.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    for program in programs {
        if memory.recorded(&program.path).is_none() {
            let own = recorded.iter().filter(|test| test.program.path == program.path).cloned().collect();
            memory.set_recorded(&program.path, own);
        }
    }
    tests.extend(recorded);
    tests.sort_by_key(|test| test.time);
    let total: Duration = tests.iter().map(|t| t.time).sum();
    eprintln!("{} tests, {:.0} s", tests.len(), total.as_secs_f64());
    Ok(tests)
}

/// Turns on each fault by itself, and says what became of it.
pub(crate) fn run_all(
    faults: &[(usize, u32, &Fault)],
    tests: &[Test],
    memory: &Memory,
    arguments: &Arguments,
) -> BTreeMap<usize, Outcome> {
    let outcomes = at_a_time(faults, arguments.jobs, |&(id, number, fault)| {
        let outcome = run(number, fault, tests, memory);
        eprintln!("{}: {outcome}", fault.title());
        (id, outcome)
    });
    outcomes.into_iter().collect()
}

/// The test that sees a fault, of those of its own crate.
fn run(number: u32, fault: &Fault, tests: &[Test], memory: &Memory) -> Outcome {
    let own = |test: &&Test| test.program.krate == fault.krate && test.reaches.contains(&number);
    let mut reaching: Vec<&Test> = tests.iter().filter(own).collect();
    // Quickest first, but for the one that saw it the last time.
    let last = memory.seen.get(&fault.key());
    reaching.sort_by_key(|test| last != Some(&test.name));
    for test in &reaching {
        let limit = test.time * PATIENCE.0 + PATIENCE.1;
        match test.program.passes(&test.name, ("PLANTED_FAULT", &number.to_string()), limit) {
            Ok(true) => {}
            Ok(false) => return Outcome::Seen(test.name.clone()),
            Err(error) => return Outcome::Broken(error.to_string()),
        }
    }
    Outcome::Missed(reaching.len())
}
