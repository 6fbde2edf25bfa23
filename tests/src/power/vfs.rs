//! A VFS layer for SQLite that forwards all calls to the system's VFS, and records writes,
//! truncations, syncs and deletions.
//!
//! The layout of the structures and the contracts of the functions follow
//! <https://sqlite.org/c3ref/io_methods.html> and <https://sqlite.org/c3ref/vfs.html>.
#![allow(unsafe_code, reason = "SQLite calls a file layer through C functions")]

use super::{Act, Acts, Recordings, name_in};
use libsqlite3_sys as ffi;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr::null_mut;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A file as SQLite sees it. The file object of the system's VFS follows directly in memory.
#[repr(C)]
struct Shim {
    base: ffi::sqlite3_file,
    /// The name of the file and the recording, or null if the file is not recorded.
    record: *mut (String, Acts),
}

static RECORDINGS: Recordings = Mutex::new(Vec::new());

/// The system's VFS.
fn system() -> *mut ffi::sqlite3_vfs {
    static SYSTEM: OnceLock<usize> = OnceLock::new();
    *SYSTEM.get_or_init(register) as *mut ffi::sqlite3_vfs
}

/// Registers the recording layer as the default for all databases opened from now on.
fn register() -> usize {
    // SAFETY: the VFS that SQLite returns lives as long as the process. The registered VFS is a
    // copy with other functions. It is leaked, so it also lives as long as the process.
    unsafe {
        let system = ffi::sqlite3_vfs_find(null_mut());
        assert!(!system.is_null(), "SQLite has no file layer");
        let mut layer = *system;
        layer.szOsFile += size_of::<Shim>() as c_int;
        layer.zName = c"recording".as_ptr();
        layer.xOpen = Some(open);
        layer.xDelete = Some(delete);
        let layer = Box::leak(Box::new(layer));
        let registered = ffi::sqlite3_vfs_register(layer, 1);
        assert_eq!(registered, ffi::SQLITE_OK, "the file layer");
        system as usize
    }
}

/// Records the operations on files of a folder that are opened from now on.
pub(super) fn record(folder: &Path, acts: &Acts) {
    let folder = folder.canonicalize().expect("a folder");
    let mut recordings = RECORDINGS.lock().unwrap_or_else(PoisonError::into_inner);
    recordings.push((folder, Arc::clone(acts)));
    drop(recordings);
    system();
}

/// The recording that contains this file, if any, and the file's name.
fn recording_of(path: *const c_char) -> Option<(String, Acts)> {
    if path.is_null() {
        return None;
    }
    // SAFETY: SQLite passes a NUL-terminated string.
    let path = unsafe { CStr::from_ptr(path) };
    let path = PathBuf::from(path.to_str().ok()?);
    let recordings = RECORDINGS.lock().unwrap_or_else(PoisonError::into_inner);
    let found =
        |(folder, acts): &(PathBuf, Acts)| Some((name_in(folder, &path)?, Arc::clone(acts)));
    recordings.iter().find_map(found)
}

fn note((name, acts): &(String, Acts), act: Act) {
    acts.lock().unwrap_or_else(PoisonError::into_inner).push((name.clone(), act));
}

/// The file object of the system's VFS.
unsafe fn own(file: *mut ffi::sqlite3_file) -> *mut ffi::sqlite3_file {
    // SAFETY: `szOsFile` makes SQLite allocate memory for both file objects.
    unsafe { file.cast::<Shim>().add(1).cast() }
}

/// Records an operation, if the file is recorded and the operation succeeded.
unsafe fn noted(file: *mut ffi::sqlite3_file, code: c_int, act: impl FnOnce() -> Act) -> c_int {
    // SAFETY: `open` sets the pointer, and `close` frees its target.
    if code == ffi::SQLITE_OK
        && let Some(record) = unsafe { (*file.cast::<Shim>()).record.as_ref() }
    {
        note(record, act());
    }
    code
}

unsafe extern "C" fn open(
    _: *mut ffi::sqlite3_vfs,
    name: ffi::sqlite3_filename,
    file: *mut ffi::sqlite3_file,
    flags: c_int,
    out_flags: *mut c_int,
) -> c_int {
    let system = system();
    // SAFETY: SQLite provides memory of `szOsFile` bytes, and does not call methods of a file whose
    // `pMethods` is null.
    unsafe {
        let shim = file.cast::<Shim>();
        (*shim).base.pMethods = std::ptr::null();
        (*shim).record = null_mut();
        let own = own(file);
        (*own).pMethods = std::ptr::null();
        let open = (*system).xOpen.expect("xOpen");
        let code = open(system, name, own, flags, out_flags);
        if code == ffi::SQLITE_OK {
            let record = recording_of(name);
            (*shim).record = record.map_or(null_mut(), |record| Box::into_raw(Box::new(record)));
            (*shim).base.pMethods = &METHODS;
        }
        code
    }
}

unsafe extern "C" fn delete(
    _: *mut ffi::sqlite3_vfs,
    name: *const c_char,
    sync_folder: c_int,
) -> c_int {
    let system = system();
    // SAFETY: the system's VFS gets the arguments that SQLite passes to a VFS.
    let code = unsafe { (*system).xDelete.expect("xDelete")(system, name, sync_folder) };
    if code == ffi::SQLITE_OK
        && let Some(record) = recording_of(name)
    {
        note(&record, Act::Deleted);
    }
    code
}

/// Defines functions that only forward their arguments.
macro_rules! passed_on {
    ($name:ident = $method:ident($($argument:ident: $kind:ty),*) -> $answer:ty) => {
        unsafe extern "C" fn $name(file: *mut ffi::sqlite3_file, $($argument: $kind),*) -> $answer {
            // SAFETY: an open file of the system's VFS has all methods of version 3.
            unsafe {
                let own = own(file);
                (*(*own).pMethods).$method.expect(stringify!($method))(own, $($argument),*)
            }
        }
    };
}

passed_on!(own_close = xClose() -> c_int);
passed_on!(read = xRead(bytes: *mut c_void, count: c_int, offset: i64) -> c_int);
passed_on!(own_write = xWrite(bytes: *const c_void, count: c_int, offset: i64) -> c_int);
passed_on!(own_truncate = xTruncate(length: i64) -> c_int);
passed_on!(own_sync = xSync(flags: c_int) -> c_int);
passed_on!(file_size = xFileSize(length: *mut i64) -> c_int);
passed_on!(lock = xLock(level: c_int) -> c_int);
passed_on!(unlock = xUnlock(level: c_int) -> c_int);
passed_on!(check_reserved_lock = xCheckReservedLock(found: *mut c_int) -> c_int);
passed_on!(file_control = xFileControl(operation: c_int, argument: *mut c_void) -> c_int);
passed_on!(sector_size = xSectorSize() -> c_int);
passed_on!(device_characteristics = xDeviceCharacteristics() -> c_int);
passed_on!(shm_map = xShmMap(page: c_int, size: c_int, extend: c_int, found: *mut *mut c_void) -> c_int);
passed_on!(shm_lock = xShmLock(offset: c_int, count: c_int, flags: c_int) -> c_int);
passed_on!(shm_barrier = xShmBarrier() -> ());
passed_on!(shm_unmap = xShmUnmap(delete: c_int) -> c_int);
passed_on!(fetch = xFetch(offset: i64, count: c_int, found: *mut *mut c_void) -> c_int);
passed_on!(unfetch = xUnfetch(offset: i64, page: *mut c_void) -> c_int);

unsafe extern "C" fn close(file: *mut ffi::sqlite3_file) -> c_int {
    // SAFETY: SQLite closes a file once, and `open` allocated the record.
    unsafe {
        let record = std::mem::replace(&mut (*file.cast::<Shim>()).record, null_mut());
        if !record.is_null() {
            drop(Box::from_raw(record));
        }
        own_close(file)
    }
}

unsafe extern "C" fn write(
    file: *mut ffi::sqlite3_file,
    bytes: *const c_void,
    count: c_int,
    offset: i64,
) -> c_int {
    // SAFETY: SQLite provides `count` bytes.
    unsafe {
        let code = own_write(file, bytes, count, offset);
        noted(file, code, || Act::Wrote {
            offset: offset as usize,
            bytes: std::slice::from_raw_parts(bytes.cast::<u8>(), count as usize).to_vec(),
        })
    }
}

unsafe extern "C" fn truncate(file: *mut ffi::sqlite3_file, length: i64) -> c_int {
    // SAFETY: as for the forwarded functions.
    unsafe {
        let code = own_truncate(file, length);
        noted(file, code, || Act::Cut { length: length as usize })
    }
}

unsafe extern "C" fn sync(file: *mut ffi::sqlite3_file, flags: c_int) -> c_int {
    // SAFETY: as for the forwarded functions.
    unsafe {
        let record = (*file.cast::<Shim>()).record.as_ref();
        // The sync does not cover writes that another thread makes during it, so the length is read
        // first.
        let covered =
            record.map_or(0, |(_, acts)| acts.lock().unwrap_or_else(PoisonError::into_inner).len());
        let code = own_sync(file, flags);
        noted(file, code, || Act::Synced { covered })
    }
}

static METHODS: ffi::sqlite3_io_methods = ffi::sqlite3_io_methods {
    iVersion: 3,
    xClose: Some(close),
    xRead: Some(read),
    xWrite: Some(write),
    xTruncate: Some(truncate),
    xSync: Some(sync),
    xFileSize: Some(file_size),
    xLock: Some(lock),
    xUnlock: Some(unlock),
    xCheckReservedLock: Some(check_reserved_lock),
    xFileControl: Some(file_control),
    xSectorSize: Some(sector_size),
    xDeviceCharacteristics: Some(device_characteristics),
    xShmMap: Some(shm_map),
    xShmLock: Some(shm_lock),
    xShmBarrier: Some(shm_barrier),
    xShmUnmap: Some(shm_unmap),
    xFetch: Some(fetch),
    xUnfetch: Some(unfetch),
};
