//! OBJ texts against values worked out by hand.

use glam::DVec3;

use crate::error::Error;
use crate::import::formats::obj::oracle::corners_of;
use crate::import::formats::obj::*;

pub(super) fn source(text: impl Into<Vec<u8>>) -> Source {
    Source::of("a.obj", text)
}

pub(super) fn load(text: impl Into<Vec<u8>>) -> (Scene, Warnings) {
    let mut warnings = Warnings::default();
    let scene = read(&source(text), &mut warnings).unwrap_or_else(|e| panic!("{e}"));
    (scene, warnings)
}

pub(super) fn meshes(scene: &Scene) -> Vec<&Mesh> {
    scene.objects.iter().filter_map(|object| object.shape.mesh()).collect()
}

#[test]
fn numbers_that_are_not_finite_are_noted_with_their_line() {
    let (_, warnings) = load("v 0 0 0\nv 1e400 0 0\nv nan 1 0\nf 1 2 3\n");
    assert_eq!(warnings.notes(), ["a.obj:2: the first vertex that is not finite"]);
}

#[test]
fn a_sign_ends_a_number() {
    let (scene, warnings) = load("v 0 0 0\nv 3.1+e2 0 0\nv 0 2-1 0\nf 1 2 3\n");
    let positions = format!("{:?}", meshes(&scene));
    assert!(positions.contains("3.1") && positions.contains("2.0"), "{positions}");
    assert_eq!(warnings.messages(), ["a.obj:2: a number with a sign in it is read up to its last sign"]);
}

#[test]
fn normals_of_smoothing_groups() {
    // A roof of two squares of side 1 at a right angle, one in z = 0 and one in x = 1; each corner of a square is 90
    // degrees, cut into triangles of 45, 90 and 45. At the ridge the squares contribute equally: (1, 0, 1) / sqrt(2).
    let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";
    let normals = |faces: &str| -> Vec<[f64; 3]> {
        let (scene, _) = load(format!("{corners}{faces}"));
        let corners = meshes(&scene).into_iter().flat_map(corners_of);
        corners.map(|corner| corner.2.unwrap_or_default()).collect()
    };
    let (z, x, ridge) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]);
    let near = |found: Vec<[f64; 3]>, expected: [[f64; 3]; 12]| {
        assert_eq!(found.len(), 12);
        for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((a - b).abs() < 1e-15, "{found:?}");
        }
    };
    let both = [z, ridge, ridge, z, ridge, z, ridge, x, x, ridge, x, ridge];
    near(normals("s 1\nf 1 2 3 4\nf 2 5 6 3\n"), both);
    // Groups go through objects and materials.
    near(normals("s 7\nf 1 2 3 4\nusemtl m\nf 2 5 6 3\n"), both);
    // Two groups, and none: a zero normal is the triangle's own.
    near(normals("s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n"), [z, z, z, z, z, z, x, x, x, x, x, x]);
    let none = [0.0; 3];
    near(
        normals("s 1\nf 1 2 3 4\ns off\nf 2 5 6 3\n"),
        [z, z, z, z, z, z, none, none, none, none, none, none],
    );
    // Normals of the file go first; the group then has one square.
    near(
        normals("vn 0 0 2\ns 1\nf 1//1 2//1 3//1 4//1\nf 2 5 6 3\n"),
        [[0.0, 0.0, 2.0]; 6].into_iter().chain([x; 6]).collect::<Vec<_>>().try_into().expect("twelve"),
    );
    // Triangles without area, and of no finite coordinates, contribute nothing.
    near(normals("v nan 0 0\ns 1\nf 1 2 3 4\nf 2 5 6 3\n"), both);
    assert!(normals("s 1\nf 1 2 2\nf 1 1 1\n").iter().flatten().all(|n| *n == 0.0));
}

#[test]
fn vertices_with_weights_colours_and_more() {
    let (scene, warnings) = load("v 2 4 6 2\nv 1 0 0 0.5 0.5\nv 0 1 0 1 0 0 1\nf 1 2 3\n");
    let mesh = meshes(&scene)[0];
    assert_eq!(mesh.positions, [DVec3::new(1.0, 2.0, 3.0), DVec3::X, DVec3::Y]);
    assert_eq!(mesh.colours.as_ref().map(|c| c.values.clone()), Some(vec![DVec3::ONE, DVec3::ONE, DVec3::X]));
    let what = "a vertex of 5 numbers; those beyond x y z, or x y z r g b, are left out";
    assert_eq!(warnings.messages(), [format!("a.obj:2: {what}")]);
}

#[test]
fn what_is_not_drawn_is_said_once() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 \\\n3\np 1\nl 1\ncstype bezier\n\
        curv 0 1 1 2\nparm u 0 \\\n1\nend\nfoo\nbar\nf 1 2 3\nusemtl m\n";
    let (scene, warnings) = load(text);
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(
        warnings.messages(),
        [
            "a.obj: points and lines are not drawn",
            "a.obj:9: free-form curves and surfaces are not drawn",
            "a.obj:13: not a statement of OBJ files; such lines are left out",
        ]
    );
}

#[test]
fn faces_without_texture_coordinates_have_those_of_the_origin() {
    let (scene, _) = load("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nf 1/1 2/1 3/1\nf 1 2 3\no b\nf 1 2 3\n");
    let uvs: Vec<_> = meshes(&scene).into_iter().flat_map(corners_of).map(|corner| corner.1).collect();
    let (given, origin) = (Some([0.5, 0.75]), Some([0.0, 1.0]));
    assert_eq!(uvs, [given, given, given, origin, origin, origin, None, None, None]);
}

#[test]
fn elements_that_are_far_apart_are_numbered_in_their_order() {
    // 40 triangles over 4 of 10,000 vertices, and 40 over all of a row.
    let vertices: String = (0..10_000).map(|i| format!("v {i} 0 0\n")).collect();
    let far = "f 10000 7 5000\nf 1 7 10000\n".repeat(20);
    let (scene, _) = load(format!("{vertices}o far\n{far}o near\nf 8 9 10\nf 11 10 8\n"));
    let [far, near] = meshes(&scene)[..] else { panic!("two objects") };
    assert_eq!(far.positions.iter().map(|p| p.x).collect::<Vec<_>>(), [0.0, 6.0, 4999.0, 9999.0]);
    assert_eq!(far.triangles[..2], [[3, 1, 2], [0, 1, 3]]);
    assert_eq!(near.positions.iter().map(|p| p.x).collect::<Vec<_>>(), [7.0, 8.0, 9.0, 10.0]);
    assert_eq!(near.triangles, [[0, 1, 2], [3, 2, 0]]);
}

#[test]
fn a_line_may_be_longer_than_a_window() {
    let face: String = (0..1000).map(|i| format!(" {}", i % 3 + 1)).collect();
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{face}\nf 1 2 x\n");
    let parsed = assembly::parse(&source(text), Sizes { window: 16, part: 16 }, &mut Warnings::default());
    let Err(Error::Input { place, .. }) = parsed else { panic!("line 5 is at fault") };
    assert_eq!(place.line, Some(5));
}
