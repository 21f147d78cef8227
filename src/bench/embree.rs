//! Embree 4, loaded at run time from the library that the environment variable `KILN_EMBREE` names.
//!
//! Only its public C API is used: `embree4/rtcore*.h` of Embree 4, whose names and numbers stand here.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::ptr;

use bytemuck::Pod;
use glam::DVec3;
use libloading::Library;

use super::{Absent, Built, Engine, Mesh};
use crate::error::{Error, Result};

/// Names the library file.
const VARIABLE: &str = "KILN_EMBREE";

const REMEDY: &str = "set KILN_EMBREE to the file of libembree4; the PyPI wheel `embreex` has one";

/// A device, scene or geometry; null where making it failed.
type Handle = *mut c_void;

/// `RTCGeometryType`.
const TRIANGLE: c_int = 0;
/// `RTCBufferType` and the `RTCFormat` that goes with it.
const INDICES: (c_int, c_int) = (0, 0x5003);
const VERTICES: (c_int, c_int) = (1, 0x9003);
/// `RTCSceneFlags`.
const ROBUST: c_int = 1 << 2;
/// `RTCDeviceProperty`.
const VERSION: c_int = 0;
/// `RTC_INVALID_GEOMETRY_ID`.
const NOTHING: c_uint = c_uint::MAX;

/// Embree finds one crossing at a time; a ray that seems to cross more than this is left at that.
const MOST_CROSSINGS: usize = 64;

/// `RTCRayHit`, as it is in builds with instance arrays; in those without, it lacks `instance_primitive`, which is last,
/// so that this serves both.
#[repr(C, align(16))]
struct RayHit {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
    normal: [f32; 3],
    barycentrics: [f32; 2],
    primitive: c_uint,
    geometry: c_uint,
    instance: c_uint,
    instance_primitive: c_uint,
}

const _: () = assert!(size_of::<RayHit>() == 96);

/// The functions of the library that are used, by their names without `rtc`.
struct Functions {
    new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    get_device_error: unsafe extern "C" fn(Handle) -> c_int,
    get_device_property: unsafe extern "C" fn(Handle, c_int) -> isize,
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    set_scene_flags: unsafe extern "C" fn(Handle, c_int),
    commit_scene: unsafe extern "C" fn(Handle),
    release_scene: unsafe extern "C" fn(Handle),
    new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    set_new_geometry_buffer: unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach_geometry: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    release_geometry: unsafe extern "C" fn(Handle),
    intersect: unsafe extern "C" fn(Handle, *mut RayHit, *mut c_void),
}

impl Functions {
    fn load(library: &'static Library) -> std::result::Result<Self, libloading::Error> {
        // SAFETY: the types are those of the functions of these names in Embree 4's headers. The library, being
        // `'static`, is never unloaded, so the pointers stay good.
        unsafe {
            Ok(Functions {
                new_device: *library.get("rtcNewDevice")?,
                get_device_error: *library.get("rtcGetDeviceError")?,
                get_device_property: *library.get("rtcGetDeviceProperty")?,
                new_scene: *library.get("rtcNewScene")?,
                set_scene_flags: *library.get("rtcSetSceneFlags")?,
                commit_scene: *library.get("rtcCommitScene")?,
                release_scene: *library.get("rtcReleaseScene")?,
                new_geometry: *library.get("rtcNewGeometry")?,
                set_new_geometry_buffer: *library.get("rtcSetNewGeometryBuffer")?,
                commit_geometry: *library.get("rtcCommitGeometry")?,
                attach_geometry: *library.get("rtcAttachGeometry")?,
                release_geometry: *library.get("rtcReleaseGeometry")?,
                intersect: *library.get("rtcIntersect1")?,
            })
        }
    }
}

/// The library, ready to build. It is kept to the end of the process, as its worker threads are.
struct Device {
    functions: Functions,
    handle: Handle,
}

// SAFETY: Embree's functions on a device may be called from any thread.
unsafe impl Sync for Device {}

impl Device {
    fn load(file: &Path) -> std::result::Result<&'static Self, String> {
        // SAFETY: loading a library runs what it has to run first. The user named the file as Embree.
        let library = unsafe { Library::new(file) }.map_err(|e| format!("{}: {e}", file.display()))?;
        let functions = Functions::load(Box::leak(Box::new(library)))
            .map_err(|e| format!("{}: not Embree 4: {e}", file.display()))?;
        // SAFETY: a null configuration asks for the defaults.
        let handle = unsafe { (functions.new_device)(ptr::null()) };
        if handle.is_null() {
            return Err(format!("{}: no device can be made", file.display()));
        }
        // SAFETY: `handle` is a device; the version is a property of every device.
        let version = unsafe { (functions.get_device_property)(handle, VERSION) };
        if version / 10_000 != 4 {
            return Err(format!("{}: version {} is not 4", file.display(), version / 10_000));
        }
        Ok(Box::leak(Box::new(Device { functions, handle })))
    }

    /// Fails where the last calls did.
    fn check(&self) -> Result<()> {
        // SAFETY: `handle` is a device.
        match unsafe { (self.functions.get_device_error)(self.handle) } {
            0 => Ok(()),
            code => Err(Error::Failed { what: format!("embree: error {code}"), hint: String::new() }),
        }
    }

    /// Makes a buffer of `geometry` with a copy of `items`.
    fn fill<T: Pod>(&self, geometry: Handle, (kind, format): (c_int, c_int), items: &[T]) -> Result<()> {
        let make = self.functions.set_new_geometry_buffer;
        // SAFETY: `geometry` is a geometry of this device. On success the buffer has room for as many items of this size
        // as are copied to it, and nothing else refers to it yet.
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

/// Both modes, where the library is there.
pub fn engines() -> std::result::Result<Vec<Box<dyn Engine>>, Absent> {
    let absent = |reason| Absent { name: "embree", reason, remedy: REMEDY };
    let file = std::env::var_os(VARIABLE).filter(|file| !file.is_empty());
    let file = file.ok_or_else(|| absent(format!("{VARIABLE} names no library")))?;
    let device = Device::load(Path::new(&file)).map_err(absent)?;
    Ok(vec![Box::new(Embree { device, robust: false }), Box::new(Embree { device, robust: true })])
}

/// Embree with its own choice of layout, in either of its modes.
struct Embree {
    device: &'static Device,
    robust: bool,
}

impl Engine for Embree {
    fn name(&self) -> &'static str {
        "embree"
    }

    fn layout(&self) -> &'static str {
        if self.robust { "robust" } else { "default" }
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        let Device { functions, handle } = self.device;
        // SAFETY: `handle` is a device. Null handles, which Embree takes and answers with an error, are found by `check`.
        let scene = unsafe { (functions.new_scene)(*handle) };
        self.device.check()?;
        let scene = Scene { device: self.device, handle: scene };
        // SAFETY: as above; the geometry is released once the scene holds it, or on failure.
        unsafe {
            (functions.set_scene_flags)(scene.handle, if self.robust { ROBUST } else { 0 });
            let geometry = (functions.new_geometry)(*handle, TRIANGLE);
            let filled = self
                .device
                .fill(geometry, VERTICES, &mesh.positions)
                .and_then(|()| self.device.fill(geometry, INDICES, &mesh.triangles));
            (functions.commit_geometry)(geometry);
            (functions.attach_geometry)(scene.handle, geometry);
            (functions.release_geometry)(geometry);
            filled?;
            (functions.commit_scene)(scene.handle);
        }
        self.device.check()?;
        Ok(Box::new(scene))
    }
}

/// A scene with one mesh in it.
struct Scene {
    device: &'static Device,
    handle: Handle,
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: `handle` is a scene of the device, released once.
        unsafe { (self.device.functions.release_scene)(self.handle) }
    }
}

// SAFETY: a scene that is built may be asked from any thread; it is changed no more.
unsafe impl Sync for Scene {}

impl Built for Scene {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let mut t_near = 0.0f32;
        for _ in 0..MOST_CROSSINGS {
            let mut query = RayHit {
                origin: origin.as_vec3().to_array(),
                t_near,
                direction: direction.as_vec3().to_array(),
                time: 0.0,
                t_far: f32::INFINITY,
                mask: c_uint::MAX,
                id: 0,
                flags: 0,
                normal: [0.0; 3],
                barycentrics: [0.0; 2],
                primitive: NOTHING,
                geometry: NOTHING,
                instance: NOTHING,
                instance_primitive: NOTHING,
            };
            // SAFETY: `handle` is a scene that is built, and `query` has the form and alignment that Embree expects; null
            // arguments ask for the defaults.
            unsafe { (self.device.functions.intersect)(self.handle, &raw mut query, ptr::null_mut()) };
            if query.geometry == NOTHING {
                return;
            }
            found.push(query.primitive);
            t_near = query.t_far.next_up();
        }
    }
}
