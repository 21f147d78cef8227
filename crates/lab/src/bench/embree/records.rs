//! Embree's ray and hit records for single rays and packets, with the last field of builds with instance arrays. Builds
//! without them ignore it.

use std::ffi::{c_int, c_uint, c_void};
use std::ptr;

use kiln::bvh::Ray;

/// `RTC_INVALID_GEOMETRY_ID`.
pub(crate) const NOTHING: c_uint = c_uint::MAX;

/// `RTCRay`.
#[repr(C, align(16))]
pub(crate) struct RayOnly {
    pub origin: [f32; 3],
    pub t_near: f32,
    pub direction: [f32; 3],
    pub time: f32,
    pub t_far: f32,
    pub mask: c_uint,
    pub id: c_uint,
    pub flags: c_uint,
}

const _: () = assert!(size_of::<RayOnly>() == 48);

impl From<&Ray> for RayOnly {
    fn from(ray: &Ray) -> Self {
        RayOnly {
            origin: ray.origin().as_vec3().to_array(),
            t_near: ray.t_min() as f32,
            direction: ray.direction().as_vec3().to_array(),
            time: 0.0,
            t_far: ray.t_max() as f32,
            mask: c_uint::MAX,
            id: 0,
            flags: 0,
        }
    }
}

/// `RTCRayHit`.
#[repr(C, align(16))]
pub(crate) struct RayHit {
    pub ray: RayOnly,
    normal: [f32; 3],
    barycentrics: [f32; 2],
    pub primitive: c_uint,
    pub geometry: c_uint,
    instance: c_uint,
    instance_primitive: c_uint,
}

const _: () = assert!(size_of::<RayHit>() == 96);

impl From<&Ray> for RayHit {
    fn from(ray: &Ray) -> Self {
        RayHit {
            ray: RayOnly::from(ray),
            normal: [0.0; 3],
            barycentrics: [0.0; 2],
            primitive: NOTHING,
            geometry: NOTHING,
            instance: NOTHING,
            instance_primitive: NOTHING,
        }
    }
}

/// `RTCRay8` and `RTCRay16`.
#[repr(C, align(64))]
pub(crate) struct Rays<const N: usize> {
    origin: [[f32; N]; 3],
    t_near: [f32; N],
    direction: [[f32; N]; 3],
    time: [f32; N],
    pub t_far: [f32; N],
    mask: [c_uint; N],
    id: [c_uint; N],
    flags: [c_uint; N],
}

const _: () = assert!(size_of::<Rays<8>>() == 8 * 48 && size_of::<Rays<16>>() == 16 * 48);

impl<const N: usize> Rays<N> {
    /// Record of at most `N` rays; the other lanes are inactive rays of length 0.
    pub(crate) fn new(rays: &[Ray]) -> Self {
        let number = |of: &dyn Fn(&Ray) -> f64, rest: f32| {
            std::array::from_fn(|lane| rays.get(lane).map_or(rest, |ray| of(ray) as f32))
        };
        Rays {
            origin: [0, 1, 2].map(|axis| number(&|ray| ray.origin()[axis], 0.0)),
            t_near: number(&|ray| ray.t_min(), 0.0),
            direction: [0, 1, 2].map(|axis| number(&|ray| ray.direction()[axis], 1.0)),
            time: [0.0; N],
            t_far: number(&|ray| ray.t_max(), -1.0),
            mask: [c_uint::MAX; N],
            id: [0; N],
            flags: [0; N],
        }
    }
}

/// `RTCRayHit8` and `RTCRayHit16`.
#[repr(C, align(64))]
pub(crate) struct RayHits<const N: usize> {
    pub rays: Rays<N>,
    normal: [[f32; N]; 3],
    barycentrics: [[f32; N]; 2],
    pub primitive: [c_uint; N],
    pub geometry: [c_uint; N],
    instance: [c_uint; N],
    instance_primitive: [c_uint; N],
}

impl<const N: usize> RayHits<N> {
    /// Record of at most `N` rays; the other lanes are inactive rays of length 0.
    pub(crate) fn new(rays: &[Ray]) -> Self {
        RayHits {
            rays: Rays::new(rays),
            normal: [[0.0; N]; 3],
            barycentrics: [[0.0; N]; 2],
            primitive: [NOTHING; N],
            geometry: [NOTHING; N],
            instance: [NOTHING; N],
            instance_primitive: [NOTHING; N],
        }
    }
}

/// Lane mask: -1 for lanes with a ray.
#[repr(C, align(64))]
pub(crate) struct Valid<const N: usize>(pub [c_int; N]);

impl<const N: usize> Valid<N> {
    pub(crate) fn first(count: usize) -> Self {
        Valid(std::array::from_fn(|lane| if lane < count { -1 } else { 0 }))
    }
}

/// `RTCIntersectArguments` and `RTCOccludedArguments`, which have the same layout. Some builds ignore the last field.
#[repr(C)]
pub(crate) struct Arguments {
    flags: c_int,
    features: c_uint,
    context: *mut c_void,
    filter: *mut c_void,
    callback: *mut c_void,
    least_width: f32,
}

impl Arguments {
    /// The defaults, with `RTC_RAY_QUERY_FLAG_COHERENT` if `coherent`.
    pub(crate) fn new(coherent: bool) -> Self {
        let nothing = ptr::null_mut();
        let flags = if coherent { 1 << 16 } else { 0 };
        let (context, filter, callback) = (nothing, nothing, nothing);
        Arguments { flags, features: c_uint::MAX, context, filter, callback, least_width: 0.0 }
    }
}
