//! Embree, a ray tracer for processors, called through its C interface: what ours is measured beside. It comes as the
//! shared library in the Python package `embreex`.

use btf_viewer::{Geometry, Instance, Triangle, Vertex};
use libloading::Library;
use std::error::Error;
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::{null, null_mut};

/// Constants of Embree 4's headers.
const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
const GEOMETRY_TYPE_INSTANCE: c_int = 121;
const BUFFER_TYPE_INDEX: c_int = 0;
const BUFFER_TYPE_VERTEX: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const FORMAT_FLOAT3X4_ROW_MAJOR: c_int = 0x9134;
const BUILD_QUALITY_HIGH: c_int = 2;
/// Number that Embree gives geometries of a ray without a hit.
const INVALID_ID: u32 = u32::MAX;
/// What a shadow ray's farthest distance becomes where something is in the way.
const OCCLUDED: f32 = f32::NEG_INFINITY;

/// `RTCRay` and `RTCHit` of Embree 4, with room behind it for what builds of the library add.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RayHit {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instances: [u32; 9],
}

impl RayHit {
    fn new(origin: [f32; 3], direction: [f32; 3], t_max: f32) -> RayHit {
        RayHit {
            origin,
            t_near: 0.0,
            direction,
            time: 0.0,
            t_far: t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            uv: [0.0; 2],
            primitive: INVALID_ID,
            geometry: INVALID_ID,
            instances: [INVALID_ID; 9],
        }
    }
}

/// Returns the vertices that a mesh's triangles use, and the number of the first.
pub(crate) fn own_vertices<'a>(vertices: &'a [Vertex], triangles: &[Triangle]) -> (u32, &'a [Vertex]) {
    let used = || triangles.iter().flat_map(|triangle| triangle.vertices);
    let first = used().min().unwrap_or(0);
    (first, &vertices[first as usize..=used().max().unwrap_or(0) as usize])
}

type Handle = *mut c_void;

/// Names the functions of the library that are used, with their types.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// Entry points of the library.
        #[allow(non_snake_case, reason = "the names of the C interface")]
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            #[allow(unsafe_code, reason = "the library gives addresses; types are those of its headers")]
            fn load(library: &Library) -> Result<Functions, libloading::Error> {
                // SAFETY: the types are copied from Embree 4's headers.
                Ok(Functions { $($name: unsafe { *library.get(stringify!($name).as_bytes())? },)* })
            }
        }
    };
}

functions! {
    rtcNewDevice: fn(*const c_char) -> Handle;
    rtcGetDeviceError: fn(Handle) -> c_int;
    rtcGetDeviceLastErrorMessage: fn(Handle) -> *const c_char;
    rtcReleaseDevice: fn(Handle);
    rtcNewScene: fn(Handle) -> Handle;
    rtcSetSceneBuildQuality: fn(Handle, c_int);
    rtcCommitScene: fn(Handle);
    rtcReleaseScene: fn(Handle);
    rtcNewGeometry: fn(Handle, c_int) -> Handle;
    rtcSetNewGeometryBuffer: fn(Handle, c_int, c_uint, c_int, usize, usize) -> Handle;
    rtcSetGeometryInstancedScene: fn(Handle, Handle);
    rtcSetGeometryTransform: fn(Handle, c_uint, c_int, *const c_void);
    rtcCommitGeometry: fn(Handle);
    rtcAttachGeometry: fn(Handle, Handle) -> c_uint;
    rtcReleaseGeometry: fn(Handle);
    rtcIntersect1: fn(Handle, *mut RayHit, *const c_void);
    rtcOccluded1: fn(Handle, *mut RayHit, *const c_void);
}

/// A scene's triangles and instances in Embree, built with its best quality.
pub struct Embree {
    functions: Functions,
    device: Handle,
    /// Of each mesh, then that of the instances, through which rays are traced.
    scenes: Vec<Handle>,
    // Never closed: its threads may still run.
    _library: ManuallyDrop<Library>,
}

impl Embree {
    /// Opens the library and builds the hierarchies of `geometry`. Cost: about a microsecond per triangle.
    ///
    /// # Errors
    /// Those of opening the library, and what it says itself.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    pub fn new(library: &Path, geometry: &Geometry) -> Result<Embree, Box<dyn Error>> {
        // SAFETY: opening it runs the set-up of its own code and no other.
        let library = unsafe { Library::new(library)? };
        let functions = Functions::load(&library)?;
        // SAFETY: handles are used as the headers say, and each is released once, in `drop`.
        unsafe {
            let device = (functions.rtcNewDevice)(null());
            let mut embree = Embree { functions, device, scenes: Vec::new(), _library: ManuallyDrop::new(library) };
            if device.is_null() {
                return Err("Embree gives no device".into());
            }
            for triangles in geometry.mesh_triangles() {
                let scene = embree.mesh(geometry.vertices(), triangles);
                embree.scenes.push(scene);
            }
            let top = embree.instances(geometry);
            embree.scenes.push(top);
            embree.check()?;
            Ok(embree)
        }
    }

    /// Builds the scene of one mesh.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    unsafe fn mesh(&self, vertices: &[Vertex], triangles: &[Triangle]) -> Handle {
        let f = &self.functions;
        let (first, vertices) = own_vertices(vertices, triangles);
        // SAFETY: both buffers are as long as was asked for, and Embree asks for 12 bytes an element.
        unsafe {
            let scene = (f.rtcNewScene)(self.device);
            (f.rtcSetSceneBuildQuality)(scene, BUILD_QUALITY_HIGH);
            let of_triangles = (f.rtcNewGeometry)(self.device, GEOMETRY_TYPE_TRIANGLE);
            let buffer = |kind, format, count: usize| {
                (f.rtcSetNewGeometryBuffer)(of_triangles, kind, 0, format, 12, count).cast::<[u32; 3]>()
            };
            let corners = buffer(BUFFER_TYPE_VERTEX, FORMAT_FLOAT3, vertices.len());
            for (number, vertex) in vertices.iter().enumerate() {
                *corners.add(number) = vertex.position.map(f32::to_bits);
            }
            let numbers = buffer(BUFFER_TYPE_INDEX, FORMAT_UINT3, triangles.len());
            for (number, triangle) in triangles.iter().enumerate() {
                *numbers.add(number) = triangle.vertices.map(|vertex| vertex - first);
            }
            self.attach(scene, of_triangles);
            (f.rtcCommitScene)(scene);
            scene
        }
    }

    /// Builds the scene of the instances, one of which, where it stands, may be the mesh itself.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    unsafe fn instances(&self, geometry: &Geometry) -> Handle {
        let f = &self.functions;
        // SAFETY: the transform is twelve numbers, row by row.
        unsafe {
            let scene = (f.rtcNewScene)(self.device);
            (f.rtcSetSceneBuildQuality)(scene, BUILD_QUALITY_HIGH);
            for (number, Instance { world_from_object, .. }) in geometry.instances().iter().enumerate() {
                let instance = (f.rtcNewGeometry)(self.device, GEOMETRY_TYPE_INSTANCE);
                (f.rtcSetGeometryInstancedScene)(instance, self.scenes[geometry.mesh_of(number)]);
                let rows: *const [[f32; 4]; 3] = world_from_object;
                (f.rtcSetGeometryTransform)(instance, 0, FORMAT_FLOAT3X4_ROW_MAJOR, rows.cast());
                self.attach(scene, instance);
            }
            (f.rtcCommitScene)(scene);
            scene
        }
    }

    #[allow(unsafe_code, reason = "Embree is a C library")]
    unsafe fn attach(&self, scene: Handle, geometry: Handle) {
        // SAFETY: the scene holds the geometry from here on.
        unsafe {
            (self.functions.rtcCommitGeometry)(geometry);
            (self.functions.rtcAttachGeometry)(scene, geometry);
            (self.functions.rtcReleaseGeometry)(geometry);
        }
    }

    /// Returns what went wrong since it was last asked.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    fn check(&self) -> Result<(), String> {
        // SAFETY: the message lives as long as the device.
        unsafe {
            match (self.functions.rtcGetDeviceError)(self.device) {
                0 => Ok(()),
                code => {
                    let message = (self.functions.rtcGetDeviceLastErrorMessage)(self.device);
                    let message = if message.is_null() { c"" } else { CStr::from_ptr(message) };
                    Err(format!("Embree: error {code}: {}", message.to_string_lossy()))
                }
            }
        }
    }

    fn top(&self) -> Handle {
        self.scenes.last().copied().unwrap_or(null_mut())
    }

    /// Returns the distance to the nearest triangle, if there is one before `t_max`.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    pub fn nearest(&self, origin: [f32; 3], direction: [f32; 3], t_max: f32) -> Option<f32> {
        let mut ray = RayHit::new(origin, direction, t_max);
        // SAFETY: the ray is aligned and larger than the library's.
        unsafe { (self.functions.rtcIntersect1)(self.top(), &raw mut ray, null()) };
        (ray.geometry != INVALID_ID).then_some(ray.t_far)
    }

    /// Tells whether a triangle is in the way before `t_max`.
    #[allow(unsafe_code, reason = "Embree is a C library")]
    pub fn occluded(&self, origin: [f32; 3], direction: [f32; 3], t_max: f32) -> bool {
        let mut ray = RayHit::new(origin, direction, t_max);
        // SAFETY: the ray is aligned and larger than the library's.
        unsafe { (self.functions.rtcOccluded1)(self.top(), &raw mut ray, null()) };
        ray.t_far == OCCLUDED
    }
}

impl Drop for Embree {
    #[allow(unsafe_code, reason = "Embree is a C library")]
    fn drop(&mut self) {
        // SAFETY: nothing uses the handles any more. Scenes of instances go before those that they place.
        unsafe {
            self.scenes.iter().rev().for_each(|scene| (self.functions.rtcReleaseScene)(*scene));
            if !self.device.is_null() {
                (self.functions.rtcReleaseDevice)(self.device);
            }
        }
    }
}
