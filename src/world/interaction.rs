//! Surface interactions: everything that shading needs of a hit, computed once, for the closest hit.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::attributes::vertex_colour;
use super::turns::sin_cos_of_turns;
use super::{InteractionSoa, PreparedMaterial, World, WorldObject};
use crate::bvh::detail::{ORIGIN_OFFSET, SurfacePoint, point_at};
use crate::bvh::{AnalyticShape, Hit, Numerics, PrimId, Primitive, Ray, Traversal};
use crate::film::ColourPipeline;
use crate::scene::TextureSlot;
use crate::scene::mesh::vertex_attributes::{blend, smooth_normal};

/// A surface interaction: a point of a surface, seen along a ray.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceInteraction {
    /// The position, with what ray origins are computed from.
    pub point: SurfacePoint,
    /// The unit vector towards the ray's origin.
    pub view: DVec3,
    /// The unit normal of the analytic shape or triangle itself, on the side of `view`.
    pub geometric_normal: DVec3,
    /// The unit normal for shading, on the side of the geometric normal.
    pub shading_normal: DVec3,
    /// Factor of the ambient light, 0 to 1.
    pub ambient: f64,
    /// The interpolated vertex colour; white without vertex colours.
    pub tint: DVec3,
    /// Whether the geometric normal is turned: the primitive's own points away from `view`.
    pub is_turned: bool,
    /// The hit.
    pub hit: Hit,
    /// The index of its object.
    pub object: u32,
    /// The index of its material.
    pub material: u32,
}

impl SurfaceInteraction {
    /// A surface at the origin that faces the view, with factors of 1.
    #[inline(always)]
    pub(crate) fn facing(view: DVec3, hit: Hit, object: u32, material: u32) -> Self {
        SurfaceInteraction {
            point: SurfacePoint { position: DVec3::ZERO, start: DVec3::ZERO, reach: DVec3::ZERO },
            view,
            geometric_normal: view,
            shading_normal: view,
            ambient: 1.0,
            tint: DVec3::ONE,
            is_turned: false,
            hit,
            object,
            material,
        }
    }
}

impl World {
    /// The surface interaction of `hit`, which must be a hit of `ray` with this world.
    #[inline(always)]
    pub fn interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction {
        let object_index = self.object_of(hit.prim);
        let object = &self.objects[object_index as usize];
        // Of length 1 up to the rounding of the ray's direction, at most 2^-24.
        let view = -ray.direction();
        let mut surface = SurfaceInteraction::facing(view, *hit, object_index, object.material);
        let is_turned = |n: DVec3| n.dot(ray.direction()) > 0.0;
        let facing = |n: DVec3| if is_turned(n) { -n } else { n };
        match self.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => {
                let (point, normal) = shape.surface(ray.at(hit.t));
                surface.point = point;
                surface.is_turned = is_turned(normal);
                surface.geometric_normal = facing(normal);
                surface.shading_normal = surface.geometric_normal;
            }
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.barycentrics;
                let barycentrics = [1.0 - v - w, v, w];
                let point = SurfacePoint::on_triangle(triangle.0, barycentrics, self.numerics());
                surface.is_turned = is_turned(triangle.normal());
                let normal = triangle.unit_normal().map_or(view, facing);
                surface.point = self.with_visible_start(point, normal, view, hit.t);
                surface.geometric_normal = normal;
                surface.shading_normal = normal;
                if let Some(smooth) = object.smooth_normal(hit.prim, barycentrics, normal) {
                    surface.shading_normal = smooth;
                }
                if let Some(tint) = object.tint(hit.prim, barycentrics, self.pipeline) {
                    surface.tint = tint;
                }
            }
        }
        surface
    }
}

impl World {
    /// The position of [`World::interaction`].
    pub fn position(&self, ray: &Ray, hit: &Hit) -> DVec3 {
        match self.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => shape.surface(ray.at(hit.t)).0.position,
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.barycentrics;
                point_at(triangle.0, [1.0 - v - w, v, w])
            }
        }
    }

    /// The geometric normal of [`World::interaction`].
    pub fn geometric_normal(&self, ray: &Ray, hit: &Hit) -> DVec3 {
        let normal = match self.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => shape.surface(ray.at(hit.t)).1,
            Primitive::Triangle(triangle) => match triangle.unit_normal() {
                Some(normal) => normal,
                None => return -ray.direction(),
            },
        };
        if normal.dot(ray.direction()) > 0.0 { -normal } else { normal }
    }
}

impl WorldObject {
    /// The interpolated vertex normal at a point of a triangle, on the side of the triangle's `normal`. `None` where
    /// there are none, they are zero, or they cancel.
    #[inline]
    pub(super) fn smooth_normal(&self, prim: PrimId, barycentrics: [f64; 3], normal: DVec3) -> Option<DVec3> {
        smooth_normal(self.attributes.normals(prim.0 - self.first.0)?, barycentrics, normal)
    }

    /// The interpolated vertex colour at a point of a triangle; `None` where there are none.
    #[inline]
    pub(super) fn tint(
        &self,
        prim: PrimId,
        barycentrics: [f64; 3],
        pipeline: ColourPipeline,
    ) -> Option<DVec3> {
        let colours = self.attributes.colours(prim.0 - self.first.0)?;
        Some(vertex_colour(blend(colours.map(|c| c.as_dvec3()), barycentrics), pipeline))
    }
}

impl World {
    /// The point, with its start moved before the hit if a face lies between the incoming ray and the start. That ray
    /// has length `distance`; `view` is the unit direction towards its origin, `normal` is on the same side. See
    /// [`SurfacePoint`](crate::bvh::detail::SurfacePoint).
    #[inline(always)]
    pub(super) fn with_visible_start(
        &self,
        point: SurfacePoint,
        normal: DVec3,
        view: DVec3,
        distance: f64,
    ) -> SurfacePoint {
        // Most points are far from edges, and start where they are.
        if point.start == point.position { point } else { self.visible_start(point, normal, view, distance) }
    }

    #[cold]
    fn visible_start(&self, point: SurfacePoint, normal: DVec3, view: DVec3, distance: f64) -> SurfacePoint {
        let numerics = self.numerics();
        if numerics == Numerics::Fast {
            return point;
        }
        let before = point.before_hit(view, distance, normal, numerics);
        let [from, to] = [before, point].map(|point| point.origin_towards(normal, numerics));
        let Some(direction) = (to - from).try_normalize() else { return point };
        let ray = numerics.ray_precision().ray(from, direction, 0.0, from.distance(to));
        let (mut hits, mut traversal) = (Vec::new(), Traversal::default());
        self.accelerator.all_hits(&ray, &mut hits, &mut traversal);
        // A face along which the incoming ray ran hides nothing: it is crossed because of rounding errors.
        let is_certain = |hit: &Hit| match self.accelerator.primitive(hit.slot) {
            Primitive::Triangle(triangle) => triangle.unit_normal().is_some_and(|normal| {
                let reach = triangle.0.iter().fold(point.reach, |reach, corner| reach.max(corner.abs()));
                let distance = normal.dot(from - triangle.0[0]).abs();
                distance > ORIGIN_OFFSET / 32.0 * reach.max_element()
            }),
            Primitive::Analytic(_) => true,
        };
        if hits.iter().any(is_certain) { before } else { point }
    }

    /// The analytic shape that a surface is on; `None` for triangles.
    pub(crate) fn shape_of(&self, surface: &SurfaceInteraction) -> Option<AnalyticShape> {
        match self.accelerator.primitive(surface.hit.slot) {
            Primitive::Analytic(shape) => Some(shape),
            Primitive::Triangle(_) => None,
        }
    }

    /// [`World::is_seen_from_back`] of a hit with an object at `position`, seen from the direction `view`.
    pub(crate) fn is_back(&self, object: u32, hit: &Hit, position: DVec3, view: DVec3) -> bool {
        let outward = match self.accelerator.primitive(hit.slot) {
            Primitive::Triangle(triangle) if self.objects[object as usize].is_mirrored => -triangle.normal(),
            Primitive::Triangle(triangle) => triangle.normal(),
            Primitive::Analytic(shape) => shape.surface(position).1,
        };
        outward.dot(view) < 0.0
    }

    /// Whether a ray hits a back face of a single-sided material.
    pub(crate) fn is_culled(&self, ray: &Ray, hit: &Hit) -> bool {
        let object = self.object_of(hit.prim);
        self.materials[self.objects[object as usize].material as usize].is_single_sided()
            && self.is_back(object, hit, ray.at(hit.t), -ray.direction())
    }

    /// Whether any object has a single-sided material.
    pub fn has_single_sided(&self) -> bool {
        self.materials_in_use().any(PreparedMaterial::is_single_sided)
    }

    /// [`World::origin_behind`] of a surface, for a `direction` below its geometric normal. Away from edges the
    /// primitive is not read.
    #[inline]
    pub(crate) fn origin_below(&self, surfaces: &InteractionSoa, i: usize, direction: DVec3) -> DVec3 {
        let (point, normal) = (surfaces.point(i), surfaces.geometric_normal.get(i));
        // Away from edges the point is that of the surface; triangles without a normal have the view as theirs.
        let is_plain = point.start == point.position && normal != surfaces.view.get(i);
        if is_plain && direction.dot(normal) < 0.0 {
            return point.origin_towards(-normal, self.numerics());
        }
        self.origin_behind(point.position, direction, &surfaces.hit(i))
    }

    /// The origin of a ray that leaves the surface at `hit`, near `position`, behind the side that was hit, in
    /// `direction`. Unlike
    /// [`SurfaceInteraction::point`] it never lies before the surface.
    pub(crate) fn origin_behind(&self, position: DVec3, direction: DVec3, hit: &Hit) -> DVec3 {
        let (point, normal) = match self.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => shape.surface(position),
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.barycentrics;
                let point = SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w], self.numerics());
                (point, triangle.unit_normal().unwrap_or(direction))
            }
        };
        let normal = if normal.dot(direction) < 0.0 { -normal } else { normal };
        point.origin_towards(normal, self.numerics())
    }

    /// The interpolated vertex opacity at a hit with an object; 1 where it has none.
    pub(crate) fn vertex_alpha(&self, object: &WorldObject, hit: &Hit) -> f64 {
        let Some(alphas) = object.attributes.alphas(hit.prim.0 - object.first.0) else { return 1.0 };
        let [v, w] = hit.barycentrics;
        blend(alphas.map(f64::from), [1.0 - v - w, v, w])
    }

    /// Whether an object's opacity can be below 1.
    pub(crate) fn is_transparent(&self, object: &WorldObject) -> bool {
        let material = &self.materials[object.material as usize];
        let has_texture = material.textures()[TextureSlot::Opacity].is_some();
        let opacity = material.opacity();
        opacity.is_some_and(|o| o.factor < 1.0 || has_texture || object.attributes.has_alphas())
    }

    /// The tangent frame at a hit with an object for a normal map: tangent, bitangent and normal, orthonormal (glTF
    /// 2.0, section 3.7.2.1). The normal is the mesh's, which may point to the other side than `shading_normal`. `None`
    /// where the mesh has no tangents, or the tangent is parallel to the normal.
    #[inline]
    pub fn tangent_frame(&self, object: u32, hit: &Hit, shading_normal: DVec3) -> Option<[DVec3; 3]> {
        let object = &self.objects[object as usize];
        let local = hit.prim.0 - object.first.0;
        let tangents = object.attributes.tangents(local)?;
        let [v, w] = hit.barycentrics;
        let barycentrics = [1.0 - v - w, v, w];
        let smooth = blend(object.attributes.normals(local)?, barycentrics);
        let side = if smooth.dot(shading_normal) < 0.0 { -1.0 } else { 1.0 };
        let normal = side * shading_normal;
        let tangent = blend(tangents.map(|t| t.truncate()), barycentrics);
        let tangent = (tangent - tangent.dot(normal) * normal).try_normalize()?;
        let handedness =
            tangents.iter().zip(barycentrics).map(|(t, weight)| t.w * weight).sum::<f64>().signum();
        Some([tangent, handedness * normal.cross(tangent), normal])
    }

    /// The unit tangent along which an anisotropic surface is rougher (KHR_materials_anisotropy): the mesh's, turned by
    /// a texel and by `rotation`, in radians, and perpendicular to `normal`. Without tangents the horizontal direction
    /// takes their place. `is_back` is [`World::is_seen_from_back`]. `None` where the tangent is parallel to the
    /// normal.
    pub(crate) fn rougher_direction(
        &self,
        (object, hit): (u32, &Hit),
        is_back: bool,
        normal: DVec3,
        texel: DVec3,
        rotation: f64,
    ) -> Option<DVec3> {
        let (sin, cos) = sin_cos_of_turns((rotation / TAU).rem_euclid(1.0));
        let texel = (2.0 * texel.truncate() - 1.0).try_normalize().unwrap_or(DVec2::X);
        let direction = DVec2::new(cos, sin).rotate(texel);
        let [tangent, bitangent, _] = self.tangent_frame(object, hit, normal).unwrap_or_else(|| {
            let outer = if is_back { -normal } else { normal };
            let tangent = DVec3::Y.cross(outer).try_normalize();
            let tangent = tangent.unwrap_or_else(|| outer.any_orthonormal_vector());
            [tangent, outer.cross(tangent), outer]
        });
        let along = direction.x * tangent + direction.y * bitangent;
        (along - along.dot(normal) * normal).try_normalize()
    }

    /// The point of a surface lifted above the tangent planes of the triangle's corners (Hanika, Hacking the Shadow
    /// Terminator, Ray Tracing Gems II, chapter 4, 2021). The point itself where there are no vertex normals.
    pub fn smooth_point(&self, surface: &SurfaceInteraction) -> SurfacePoint {
        let (object, hit) = (&self.objects[surface.object as usize], &surface.hit);
        let Some(normals) = object.attributes.normals(hit.prim.0 - object.first.0) else {
            return surface.point;
        };
        let Primitive::Triangle(triangle) = self.accelerator.primitive(hit.slot) else {
            return surface.point;
        };
        let [v, w] = hit.barycentrics;
        let barycentrics = [1.0 - v - w, v, w];
        // Vertex normals turned to the side of the geometric normal: a normal map may have changed the shading normal.
        let smooth = blend(normals, barycentrics);
        let side = match smooth.try_normalize() {
            Some(smooth) if smooth.dot(surface.geometric_normal) < 0.0 => -1.0,
            Some(_) => 1.0,
            None => smooth.dot(surface.geometric_normal).signum(),
        };
        let mut lift = DVec3::ZERO;
        for ((corner, normal), weight) in triangle.0.iter().zip(normals).zip(barycentrics) {
            let normal = normal * side;
            let below = (surface.point.position - corner).dot(normal).min(0.0);
            lift -= weight * below * normal;
        }
        surface.point.moved(lift)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat4;

    use super::*;
    use crate::bvh::detail::Layout;
    use crate::scene::{Attribute, Mesh, Placed, Placement, Scene, Shape};

    /// A mesh of four triangles around the z axis, with vertex normals of any length, one of them zero, and texture
    /// coordinates with indices of their own.
    fn mesh() -> Mesh {
        let rim = |i: u32| [[1.0, 0.1, 0.0], [0.0, 1.0, 0.3], [-1.0, 0.0, 0.0], [0.1, -1.0, 0.2]][i as usize];
        let mut positions: Vec<DVec3> = (0..4).map(|i| rim(i).into()).collect();
        positions.push(DVec3::new(0.0, 0.0, 0.7));
        let normals = (0..5).map(|i| DVec3::new(0.3, 0.1 * f64::from(i), 2.0) * f64::from(i % 4));
        let corners: Vec<[u32; 3]> = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let uvs = (0..12).map(|i| DVec2::new(f64::from(i) / 7.0, f64::from(i * i % 5) / 3.0)).collect();
        Mesh {
            triangles: (0..4).map(|i| [i, (i + 1) % 4, 4]).collect(),
            normals: Some(Attribute::per_position(normals.collect())),
            uvs: vec![Attribute { values: uvs, triangles: Some(corners) }],
            positions,
            ..Mesh::default()
        }
    }

    /// Attributes of the description are those of the prepared scene, to the bit: of a mesh, of placements of which one
    /// mirrors, and of a mesh without attributes.
    #[test]
    fn attributes_of_shapes_are_those_of_interactions() {
        let moved = |x: f64| DMat4::from_translation(DVec3::new(x, 0.2, 0.1));
        let (shared, plain) = (Arc::new(mesh()), Mesh { normals: None, uvs: Vec::new(), ..mesh() });
        let turned = moved(3.0) * DMat4::from_rotation_y(0.4) * DMat4::from_scale(DVec3::new(1.0, -0.7, 1.3));
        let placed = |map| Shape::Placed(Placed::new(Arc::clone(&shared), Placement::new(map)));
        let mut far = plain;
        far.transform(&moved(9.0));
        let scene =
            Scene::from_iter([Shape::Mesh(mesh()), placed(turned), placed(moved(6.0)), Shape::Mesh(far)]);
        let world =
            World::prepare(scene.clone(), ColourPipeline::Linear, Layout::default(), Numerics::Double);
        let precision = Numerics::Double.ray_precision();
        let mut counts = [0; 4];
        for i in 0..400u32 {
            let origin = DVec3::new(f64::from(i) / 40.0 - 0.7, f64::from(i * 37 % 100) / 60.0 - 0.8, 5.0);
            let direction = DVec3::new(0.01, 0.02, if i % 2 == 0 { -1.0 } else { 1.0 }).normalize();
            let origin = DVec3::new(origin.x, origin.y, -direction.z.signum() * origin.z);
            let ray = precision.ray(origin, direction, 0.0, f64::INFINITY);
            let Some(hit) = world.accelerator.closest_hit(&ray, &mut Traversal::default()) else { continue };
            let (object, primitive) = scene.object_of(hit.prim).expect("of the scene");
            let (surface, shape) = (world.interaction(&ray, &hit), &scene.objects[object].shape);
            let [v, w] = hit.barycentrics;
            let barycentrics = [1.0 - v - w, v, w];
            let normal = shape.shading_normal(primitive as u32, barycentrics, surface.geometric_normal);
            assert_eq!(normal, surface.shading_normal, "{object} {primitive}");
            let uv = world.texture_point((object as u32, &hit, normal), &ray, None, 0).map(|point| point.uv);
            assert_eq!(shape.uv(primitive as u32, barycentrics, 0), uv);
            assert_eq!((uv.is_some(), normal != surface.geometric_normal), (object < 3, object < 3));
            counts[object] += 1;
        }
        assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
        assert!(scene.placement_indices().eq([0, 0, 1, 0]));
    }
}
