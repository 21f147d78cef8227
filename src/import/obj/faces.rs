//! Faces of an OBJ text as vectors of indices.

/// Indices of the corners of faces count from 0. Values from here on are indices relative to the first element of the
/// part, plus [`RELATIVE_BIAS`].
pub(super) const RELATIVE: u32 = 1 << 31;
/// Added to relative indices, which may be negative.
pub(super) const RELATIVE_BIAS: i64 = 1 << 29;
/// Values from here on stand for an element that is not given: a texture coordinate, or a normal, which is that of
/// smoothing group `index - MISSING`; 0 stands for the normal of the triangle.
pub(super) const MISSING: u32 = 3 << 30;
/// Stands for a normal of the smoothing group that is current where the part begins.
pub(super) const INHERITED: u32 = u32::MAX;

/// Faces: triangles in vectors by themselves, polygons of more corners in others.
#[derive(Debug, Default)]
pub(super) struct Faces {
    /// Indices of positions, texture coordinates and normals. The second or third is empty if none of them is given.
    pub triangles: [Vec<[u32; 3]>; 3],
    pub polygons: Vec<Polygon>,
    /// The corners of all polygons, with the three indices of each.
    pub corners: Vec<[u32; 3]>,
}

/// A polygon of four or more corners, up to the first corner of the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon {
    /// Number of triangles before it in the text.
    pub triangles_before: usize,
    pub first_corner: usize,
}

/// Numbers of triangles and polygons.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Count {
    pub triangles: usize,
    pub polygons: usize,
}

impl Faces {
    pub(super) fn count(&self) -> Count {
        Count { triangles: self.triangles[0].len(), polygons: self.polygons.len() }
    }

    /// Size of the indices in bytes.
    pub(super) fn bytes(&self) -> usize {
        let triangles: usize = self.triangles.iter().map(Vec::len).sum();
        12 * (triangles + self.corners.len()) + size_of_val(&self.polygons[..])
    }

    /// Index of the first corner of polygon `polygon`, which may be the end.
    pub(super) fn first_corner(&self, polygon: usize) -> usize {
        self.polygons.get(polygon).map_or(self.corners.len(), |polygon| polygon.first_corner)
    }
}
