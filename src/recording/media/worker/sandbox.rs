//! Gives up what decoding does not need, before anything from outside is read.

use landlock::{
    ABI, Access as _, AccessFs, AccessNet, CompatLevel, Compatible as _, LandlockStatus, PathBeneath,
    Ruleset, RulesetAttr as _, RulesetCreatedAttr as _, RulesetStatus, Scope, path_beneath_rules,
};
use rustix::process::{Resource, Rlimit};
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter, SeccompRule,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};

/// Most bytes of its own that a worker may have: decoders of the largest pictures that are allowed keep some twenty of them.
pub(super) const MAX_DATA_BYTES: u64 = 2 << 30;

/// Most bytes of addresses, where libraries and the daemon's memory count too.
const MAX_ADDRESS_BYTES: u64 = 32 << 30;

/// Flag of files that are made without a name; the library's has the flag of folders in it.
const OPEN_UNNAMED: i32 = libc::O_TMPFILE & !libc::O_DIRECTORY;

/// Most open files: one for each block of pictures.
const MAX_FILES: u64 = 4096;

/// Parts of the sandbox that hold a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sandbox {
    /// True where memory, files to be written and open files are limited.
    pub has_limits: bool,
    /// Version of Landlock by which files are kept from it; none where the kernel has none.
    pub landlock_abi: Option<u8>,
    /// True where all system calls but those of decoding are refused, those of networks among them.
    pub has_seccomp: bool,
}

/// A process that decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decoding {
    /// Number of the process.
    pub process_id: u32,
    /// Parts of the sandbox that hold it.
    pub sandbox: Sandbox,
    /// True where a control group limits its processor time and memory.
    pub has_control_group: bool,
}

/// Confines this process, which has one thread, for good. It may still read `file`.
pub(super) fn confine(file: Option<BorrowedFd<'_>>) -> Sandbox {
    let has_limits = set_limits().inspect_err(|error| note("limits", error)).is_ok();
    let landlock_abi = restrict_files(file).inspect_err(|error| note("Landlock", error)).ok().flatten();
    let has_seccomp = restrict_calls().inspect_err(|error| note("seccomp", error)).is_ok();
    Sandbox { has_limits, landlock_abi, has_seccomp }
}

fn note(part: &str, error: &dyn std::fmt::Display) {
    tracing::debug!(part, %error, "a part of the sandbox does not hold");
}

fn set_limits() -> rustix::io::Result<()> {
    let limits = [
        (Resource::Core, 0),
        (Resource::Fsize, 0),
        (Resource::Data, MAX_DATA_BYTES),
        (Resource::As, MAX_ADDRESS_BYTES),
        (Resource::Nofile, MAX_FILES),
    ];
    for (resource, wanted) in limits {
        // A lower limit that somebody else set holds.
        let most = rustix::process::getrlimit(resource).maximum.map_or(wanted, |most| most.min(wanted));
        rustix::process::setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) })?;
    }
    Ok(())
}

/// Folders from which libraries and `GStreamer`'s plugins are loaded.
fn library_folders() -> Vec<PathBuf> {
    let usual = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/lib", "/lib64", "/etc/ld.so.cache"];
    let mut folders: Vec<PathBuf> = usual.into_iter().map(PathBuf::from).collect();
    // Decoders ask how many processors there are.
    folders.push("/sys/devices/system/cpu".into());
    folders.extend(std::env::var_os("LD_LIBRARY_PATH").iter().flat_map(std::env::split_paths));
    let plugins = gstreamer::Registry::get().plugins();
    let files = plugins.into_iter().filter_map(|plugin| plugin.filename());
    // Libraries of plugins lie beside them or one folder up, wherever that is.
    folders.extend(files.flat_map(|file| {
        let folders = file.ancestors().skip(1).take(2);
        folders.filter(|folder| folder.components().count() > 2).map(Path::to_path_buf).collect::<Vec<_>>()
    }));
    folders.extend(["/nix/store", "/gnu/store"].map(PathBuf::from));
    folders.sort_unstable();
    folders.dedup();
    folders
}

/// Keeps all files from this process but libraries and `file`; the version of Landlock that does, if any.
fn restrict_files(file: Option<BorrowedFd<'_>>) -> Result<Option<u8>, landlock::RulesetError> {
    let abi = ABI::V6;
    let read = AccessFs::ReadFile | AccessFs::ReadDir;
    let mut rules = Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(AccessFs::from_all(abi))?
        .handle_access(AccessNet::from_all(abi))?
        .scope(Scope::from_all(abi))?
        .create()?
        .add_rules(path_beneath_rules(library_folders(), read))?;
    if let Some(file) = file {
        rules = rules.add_rule(PathBeneath::new(file, AccessFs::ReadFile))?;
    }
    let status = rules.restrict_self()?;
    let abi = match status.landlock {
        LandlockStatus::Available { effective_abi, .. } => Some(effective_abi as u8),
        _ => None,
    };
    Ok(abi.filter(|_| status.ruleset != RulesetStatus::NotEnforced))
}

/// Refuses all system calls but those of decoding.
fn restrict_calls() -> Result<(), seccompiler::Error> {
    // New threads: the C library falls back to the older call, whose flags can be looked at.
    let absent = BTreeMap::from([(libc::SYS_clone3, Vec::new())]);
    apply(absent, SeccompAction::Allow, SeccompAction::Errno(libc::ENOSYS as u32))?;
    let mut calls: BTreeMap<i64, Vec<SeccompRule>> =
        CALLS.iter().chain(CALLS_OF_ARCHITECTURE).map(|call| (*call, Vec::new())).collect();
    calls.insert(libc::SYS_clone3, Vec::new());
    let thread = libc::CLONE_THREAD as u64;
    calls.insert(libc::SYS_clone, vec![rule(0, SeccompCmpOp::MaskedEq(thread), thread)?]);
    let file_flags = (libc::O_ACCMODE | libc::O_CREAT | libc::O_TRUNC | OPEN_UNNAMED) as u64;
    calls.insert(libc::SYS_openat, vec![word_rule(2, SeccompCmpOp::MaskedEq(file_flags), 0)?]);
    #[cfg(target_arch = "x86_64")]
    calls.insert(libc::SYS_open, vec![word_rule(1, SeccompCmpOp::MaskedEq(file_flags), 0)?]);
    let asks = [
        libc::F_DUPFD,
        libc::F_DUPFD_CLOEXEC,
        libc::F_GETFD,
        libc::F_SETFD,
        libc::F_GETFL,
        libc::F_GET_SEALS,
    ];
    let mut commands = Vec::new();
    for command in asks {
        commands.push(word_rule(1, SeccompCmpOp::Eq, command as u64)?);
    }
    // A file that tells of itself by signals would send them to whom it is told.
    let signals = libc::O_ASYNC as u64;
    commands.push(SeccompRule::new(vec![
        SeccompCondition::new(1, SeccompCmpArgLen::Dword, SeccompCmpOp::Eq, libc::F_SETFL as u64)?,
        SeccompCondition::new(2, SeccompCmpArgLen::Dword, SeccompCmpOp::MaskedEq(signals), 0)?,
    ])?);
    calls.insert(libc::SYS_fcntl, commands);
    let own = u64::from(std::process::id());
    calls.insert(libc::SYS_tgkill, vec![rule(0, SeccompCmpOp::Eq, own)?]);
    calls.insert(libc::SYS_prctl, vec![rule(0, SeccompCmpOp::Eq, libc::PR_SET_NAME as u64)?]);
    // Messages of GStreamer wake who waits for them by such a pair.
    calls.insert(libc::SYS_socketpair, vec![rule(0, SeccompCmpOp::Eq, libc::AF_UNIX as u64)?]);
    // Limits may be asked for.
    calls.insert(libc::SYS_prlimit64, vec![rule(2, SeccompCmpOp::Eq, 0)?]);
    apply(calls, SeccompAction::Errno(libc::EPERM as u32), SeccompAction::Allow)
}

fn rule(argument: u8, compare: SeccompCmpOp, value: u64) -> Result<SeccompRule, seccompiler::Error> {
    let condition = SeccompCondition::new(argument, SeccompCmpArgLen::Qword, compare, value)?;
    Ok(SeccompRule::new(vec![condition])?)
}

/// Returns a rule on an argument of 32 bits.
fn word_rule(argument: u8, compare: SeccompCmpOp, value: u64) -> Result<SeccompRule, seccompiler::Error> {
    let condition = SeccompCondition::new(argument, SeccompCmpArgLen::Dword, compare, value)?;
    Ok(SeccompRule::new(vec![condition])?)
}

fn apply(
    calls: BTreeMap<i64, Vec<SeccompRule>>,
    others: SeccompAction,
    named: SeccompAction,
) -> Result<(), seccompiler::Error> {
    let architecture = std::env::consts::ARCH.try_into()?;
    let program: BpfProgram = SeccompFilter::new(calls, others, named, architecture)?.try_into()?;
    seccompiler::apply_filter_all_threads(&program)
}

/// Calls that decoding makes: memory, threads, waiting, time, libraries to be loaded, and the socket that is there already.
const CALLS: &[i64] = &[
    libc::SYS_brk,
    libc::SYS_clock_getres,
    libc::SYS_clock_gettime,
    libc::SYS_clock_nanosleep,
    libc::SYS_close,
    libc::SYS_dup,
    libc::SYS_epoll_create1,
    libc::SYS_epoll_ctl,
    libc::SYS_epoll_pwait,
    libc::SYS_eventfd2,
    libc::SYS_exit,
    libc::SYS_exit_group,
    libc::SYS_faccessat,
    libc::SYS_fallocate,
    libc::SYS_fstat,
    libc::SYS_fstatfs,
    libc::SYS_futex,
    libc::SYS_getcwd,
    libc::SYS_getdents64,
    libc::SYS_getegid,
    libc::SYS_geteuid,
    libc::SYS_getgid,
    libc::SYS_getpid,
    libc::SYS_getppid,
    libc::SYS_getrandom,
    libc::SYS_getrusage,
    libc::SYS_gettid,
    libc::SYS_getuid,
    libc::SYS_lseek,
    libc::SYS_madvise,
    libc::SYS_membarrier,
    libc::SYS_mmap,
    libc::SYS_mprotect,
    libc::SYS_mremap,
    libc::SYS_munmap,
    libc::SYS_nanosleep,
    libc::SYS_newfstatat,
    libc::SYS_pipe2,
    libc::SYS_ppoll,
    libc::SYS_pread64,
    libc::SYS_read,
    libc::SYS_readlinkat,
    libc::SYS_readv,
    libc::SYS_recvfrom,
    libc::SYS_recvmsg,
    libc::SYS_restart_syscall,
    libc::SYS_rseq,
    libc::SYS_rt_sigaction,
    libc::SYS_rt_sigprocmask,
    libc::SYS_rt_sigreturn,
    libc::SYS_sched_getaffinity,
    libc::SYS_sched_getattr,
    libc::SYS_sched_yield,
    libc::SYS_sendmsg,
    libc::SYS_sendto,
    libc::SYS_set_robust_list,
    libc::SYS_sigaltstack,
    libc::SYS_statx,
    libc::SYS_sysinfo,
    libc::SYS_uname,
    libc::SYS_write,
    libc::SYS_writev,
];

/// Older forms of such calls, which some architectures have.
#[cfg(target_arch = "x86_64")]
const CALLS_OF_ARCHITECTURE: &[i64] = &[
    libc::SYS_access,
    libc::SYS_arch_prctl,
    libc::SYS_epoll_wait,
    libc::SYS_gettimeofday,
    libc::SYS_lstat,
    libc::SYS_pipe,
    libc::SYS_poll,
    libc::SYS_readlink,
    libc::SYS_select,
    libc::SYS_stat,
    libc::SYS_time,
];

/// Older forms of such calls, which some architectures have.
#[cfg(not(target_arch = "x86_64"))]
const CALLS_OF_ARCHITECTURE: &[i64] = &[];
