//! Embree 4, loaded at run time from the library that the environment variable `KILN_EMBREE` names.
//!
//! Only its public C API is used; names and values are those of `embree4/rtcore*.h` of Embree 4.

mod engines;
mod records;

pub(crate) use engines::{engines, leak_engines};

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::ptr;
use std::sync::atomic::{AtomicIsize, Ordering};

use bytemuck::Pod;
use libloading::Library;

use super::{Mesh, Unavailable};
use kiln::error::{Error, Result};
use records::{Arguments, RayHit, RayHits, RayOnly, Rays};

/// Environment variable with the path of the library.
const VARIABLE: &str = "KILN_EMBREE";

const REMEDY: &str = "set KILN_EMBREE to the file of libembree4; the PyPI wheel `embreex` has one";

/// A device, scene, geometry or buffer; null if its creation failed.
type Handle = *mut c_void;

/// `RTCGeometryType`.
const TRIANGLE: c_int = 0;
/// `RTCBufferType` with its `RTCFormat`.
const INDICES: (c_int, c_int) = (0, 0x5003);
const VERTICES: (c_int, c_int) = (1, 0x9003);
/// `RTCSceneFlags`.
const ROBUST: c_int = 1 << 2;
/// `RTCDeviceProperty`.
const VERSION: c_int = 0;
const NATIVE_RAY8: c_int = 33;
const NATIVE_RAY16: c_int = 34;

/// `RTCBuildQuality`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quality {
    Medium = 1,
    High = 2,
}

/// `RTCMemoryMonitorFunction`.
type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// Memory of all devices in bytes.
static BYTES: AtomicIsize = AtomicIsize::new(0);

/// Counts Embree's allocations, and permits them.
unsafe extern "C" fn count_bytes(_: *mut c_void, bytes: isize, _: bool) -> bool {
    BYTES.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// Declares [`Functions`] by names, symbols and types.
macro_rules! functions {
    ($($name:ident = $symbol:literal: $type:ty,)*) => {
        /// Functions of the library, named without the prefix `rtc`.
        struct Functions {
            $($name: $type,)*
        }

        impl Functions {
            fn load(library: &'static Library) -> std::result::Result<Self, libloading::Error> {
                // SAFETY: the types are those of the functions in Embree 4's headers. The library is `'static` and never
                // unloaded, so the pointers stay valid.
                unsafe { Ok(Functions { $($name: *library.get::<$type>($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    new_device = "rtcNewDevice": unsafe extern "C" fn(*const c_char) -> Handle,
    get_device_error = "rtcGetDeviceError": unsafe extern "C" fn(Handle) -> c_int,
    get_device_property = "rtcGetDeviceProperty": unsafe extern "C" fn(Handle, c_int) -> isize,
    set_device_memory_monitor_function = "rtcSetDeviceMemoryMonitorFunction": unsafe extern "C" fn(Handle, MemoryMonitor, *mut c_void),
    new_scene = "rtcNewScene": unsafe extern "C" fn(Handle) -> Handle,
    set_scene_flags = "rtcSetSceneFlags": unsafe extern "C" fn(Handle, c_int),
    commit_scene = "rtcCommitScene": unsafe extern "C" fn(Handle),
    release_scene = "rtcReleaseScene": unsafe extern "C" fn(Handle),
    new_geometry = "rtcNewGeometry": unsafe extern "C" fn(Handle, c_int) -> Handle,
    set_new_geometry_buffer = "rtcSetNewGeometryBuffer": unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void,
    commit_geometry = "rtcCommitGeometry": unsafe extern "C" fn(Handle),
    attach_geometry = "rtcAttachGeometry": unsafe extern "C" fn(Handle, Handle) -> c_uint,
    release_geometry = "rtcReleaseGeometry": unsafe extern "C" fn(Handle),
    set_scene_build_quality = "rtcSetSceneBuildQuality": unsafe extern "C" fn(Handle, c_int),
    intersect = "rtcIntersect1": unsafe extern "C" fn(Handle, *mut RayHit, *mut Arguments),
    intersect8 = "rtcIntersect8": unsafe extern "C" fn(*const c_int, Handle, *mut RayHits<8>, *mut Arguments),
    intersect16 = "rtcIntersect16": unsafe extern "C" fn(*const c_int, Handle, *mut RayHits<16>, *mut Arguments),
    occluded = "rtcOccluded1": unsafe extern "C" fn(Handle, *mut RayOnly, *mut Arguments),
    occluded8 = "rtcOccluded8": unsafe extern "C" fn(*const c_int, Handle, *mut Rays<8>, *mut Arguments),
    occluded16 = "rtcOccluded16": unsafe extern "C" fn(*const c_int, Handle, *mut Rays<16>, *mut Arguments),
}

/// An Embree device. It lives until the end of the process, like its worker threads.
struct Device {
    functions: Functions,
    handle: Handle,
}

// SAFETY: Embree's functions on a device may be called from any thread.
unsafe impl Sync for Device {}

impl Device {
    /// The device of the library that [`VARIABLE`] names. `configuration` is passed to Embree, such as `threads=1`.
    fn find(configuration: &str) -> std::result::Result<&'static Self, Unavailable> {
        let absent = |reason| Unavailable { name: "embree", reason, remedy: REMEDY };
        let file = std::env::var_os(VARIABLE).filter(|file| !file.is_empty());
        let file = file.ok_or_else(|| absent(format!("{VARIABLE} names no library")))?;
        Device::load(Path::new(&file), configuration).map_err(absent)
    }

    fn load(file: &Path, configuration: &str) -> std::result::Result<&'static Self, String> {
        // SAFETY: loading a library runs its initialisers. The user named the file as Embree.
        let library = unsafe { Library::new(file) }.map_err(|e| format!("{}: {e}", file.display()))?;
        let functions = Functions::load(Box::leak(Box::new(library)))
            .map_err(|e| format!("{}: not Embree 4: {e}", file.display()))?;
        let configuration = CString::new(configuration).map_err(|e| e.to_string())?;
        // SAFETY: the configuration is a zero-terminated string; an empty one means the defaults.
        let handle = unsafe { (functions.new_device)(configuration.as_ptr()) };
        if handle.is_null() {
            return Err(format!("{}: no device can be made", file.display()));
        }
        // SAFETY: `handle` is a device, and the function may be called from any thread.
        unsafe { (functions.set_device_memory_monitor_function)(handle, count_bytes, ptr::null_mut()) };
        let device = Device { functions, handle };
        let version = device.property(VERSION);
        if version / 10_000 != 4 {
            return Err(format!("{}: version {} is not 4", file.display(), version / 10_000));
        }
        Ok(Box::leak(Box::new(device)))
    }

    fn property(&self, property: c_int) -> isize {
        // SAFETY: `handle` is a device; an unknown property returns 0 and sets an error.
        unsafe { (self.functions.get_device_property)(self.handle, property) }
    }

    /// Returns the error of the last calls.
    fn check(&self) -> Result<()> {
        // SAFETY: `handle` is a device.
        match unsafe { (self.functions.get_device_error)(self.handle) } {
            0 => Ok(()),
            code => Err(Error::Failed { what: format!("embree: error {code}"), hint: String::new() }),
        }
    }

    /// Creates a buffer of `geometry` with a copy of `items`.
    fn fill<T: Pod>(&self, geometry: Handle, (kind, format): (c_int, c_int), items: &[T]) -> Result<()> {
        let make = self.functions.set_new_geometry_buffer;
        // SAFETY: `geometry` is a geometry of this device. On success the buffer has the size of the copied items, and
        // there is no other reference to it yet.
        unsafe {
            let buffer = make(geometry, kind, 0, format, size_of::<T>(), items.len());
            if buffer.is_null() {
                self.check()?;
                return Err(Error::Failed { what: "embree: no buffer".into(), hint: String::new() });
            }
            ptr::copy_nonoverlapping(items.as_ptr(), buffer.cast(), items.len());
        }
        Ok(())
    }
}

/// A committed scene with one mesh.
struct Scene {
    device: &'static Device,
    handle: Handle,
    /// Its memory in bytes, provided that nothing else was built meanwhile.
    bytes: isize,
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: `handle` is a scene of the device, released once.
        unsafe { (self.device.functions.release_scene)(self.handle) }
    }
}

// SAFETY: a committed scene may be queried from any thread; it is not changed any more.
unsafe impl Sync for Scene {}

// SAFETY: a scene may be released by any thread.
unsafe impl Send for Scene {}

impl Scene {
    /// Builds a scene over a mesh.
    fn new(device: &'static Device, quality: Quality, robust: bool, mesh: &Mesh) -> Result<Self> {
        let Device { functions, handle } = device;
        // SAFETY: `handle` is a device. Embree accepts null handles and sets an error, which `check` returns.
        let scene = unsafe { (functions.new_scene)(*handle) };
        device.check()?;
        let before = BYTES.load(Ordering::Relaxed);
        let mut scene = Scene { device, handle: scene, bytes: 0 };
        // SAFETY: as above; the geometry is released once the scene holds it, or on failure.
        unsafe {
            (functions.set_scene_flags)(scene.handle, if robust { ROBUST } else { 0 });
            (functions.set_scene_build_quality)(scene.handle, quality as c_int);
            let geometry = (functions.new_geometry)(*handle, TRIANGLE);
            let filled = device
                .fill(geometry, VERTICES, &mesh.positions)
                .and_then(|()| device.fill(geometry, INDICES, &mesh.triangles));
            (functions.commit_geometry)(geometry);
            (functions.attach_geometry)(scene.handle, geometry);
            (functions.release_geometry)(geometry);
            filled?;
            (functions.commit_scene)(scene.handle);
        }
        device.check()?;
        scene.bytes = BYTES.load(Ordering::Relaxed) - before;
        Ok(scene)
    }
}
