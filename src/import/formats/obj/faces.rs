//! Faces of an OBJ text as vectors of indices.

/// Indices of the corners of faces count from 0. Values from here on are indices relative to the first element of the
/// part, plus [`RELATIVE_BIAS`].
pub(super) const RELATIVE: u32 = 1 << 31;
/// Index of a non-existent element.
pub(super) const INVALID_INDEX: u32 = RELATIVE - 1;
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

impl Count {
    pub(super) fn add(&mut self, other: Count) {
        self.triangles += other.triangles;
        self.polygons += other.polygons;
    }
}

impl Faces {
    pub(super) fn count(&self) -> Count {
        Count { triangles: self.triangles[0].len(), polygons: self.polygons.len() }
    }

    /// Removes invalid indices: faces with an invalid position, and the texture coordinates or normals of faces with an
    /// invalid one. Returns the number of faces removed.
    pub(super) fn leave_out(&mut self, totals: [u64; 3]) -> Count {
        let before = self.count();
        let is_there = |kind: usize, index: u32| index >= MISSING || u64::from(index) < totals[kind];
        let [positions, others @ ..] = &mut self.triangles;
        for (triangles, kind) in others.iter_mut().zip(1..) {
            let without = |triangle: &&mut [u32; 3]| !triangle.iter().all(|&index| is_there(kind, index));
            triangles.iter_mut().filter(without).for_each(|triangle| *triangle = [MISSING; 3]);
        }
        let kept: Vec<bool> =
            positions.iter().map(|triangle| triangle.iter().all(|&i| is_there(0, i))).collect();
        for indices in &mut self.triangles {
            let mut kept = kept.iter();
            indices.retain(|_| kept.next() == Some(&true));
        }
        // Number of kept triangles before each triangle.
        let mut sums = Vec::with_capacity(kept.len() + 1);
        sums.push(0);
        sums.extend(kept.iter().scan(0, |sum, &is_kept| {
            *sum += usize::from(is_kept);
            Some(*sum)
        }));
        let all = std::mem::take(&mut self.polygons);
        let corners = std::mem::take(&mut self.corners);
        let ends = all.iter().skip(1).map(|next| next.first_corner).chain([corners.len()]);
        for (polygon, end) in all.iter().zip(ends) {
            let corners = &corners[polygon.first_corner..end];
            if !corners.iter().all(|corner| is_there(0, corner[0])) {
                continue;
            }
            let is_whole = [0, 1, 2].map(|kind| corners.iter().all(|corner| is_there(kind, corner[kind])));
            let first_corner = self.corners.len();
            self.polygons.push(Polygon { triangles_before: sums[polygon.triangles_before], first_corner });
            let index = |corner: &[u32; 3], kind: usize| if is_whole[kind] { corner[kind] } else { MISSING };
            self.corners.extend(corners.iter().map(|corner| [0, 1, 2].map(|kind| index(corner, kind))));
        }
        let after = self.count();
        Count { triangles: before.triangles - after.triangles, polygons: before.polygons - after.polygons }
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
