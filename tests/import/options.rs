//! Options of reading on mesh files and on scene files: materials, smooth normals, up axis, single-sided materials.

use crate::common::borders::Folder;
use crate::common::gltf::png;
use glam::DVec3;
use kiln::error::{Error, Result, Warnings};
use kiln::scene::{
    Degrees, ImportOptions, Material, MaterialChoice, OptionValue, Phong, Scene, UpAxis, UpChoice,
};

/// Two objects of one triangle each, `lid` of the material `cast` and `pot` without one.
const POT: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib a.mtl\no lid\nusemtl cast\nf 1 2 3\no pot\nusemtl grey\nf 1 3 2\n";

fn load(folder: &Folder, name: &str, options: &ImportOptions) -> Result<(Scene, Warnings)> {
    let mut warnings = Warnings::default();
    let scene = kiln::import::load_with(&[folder.0.path().join(name)], options, &mut warnings)?;
    Ok((scene, warnings))
}

/// The colours of the materials of all objects, in the order of the objects, after `--material` options.
fn colours(folder: &Folder, name: &str, options: &[&str]) -> Result<Vec<String>> {
    let materials = options.iter().map(|text| MaterialChoice::parse(text).expect("a choice")).collect();
    let (scene, _) = load(folder, name, &ImportOptions { materials, ..ImportOptions::default() })?;
    let colour = |id: kiln::scene::MaterialId| format!("{:?}", scene.materials[id.0 as usize].colour());
    Ok(scene.objects.iter().map(|object| colour(object.material)).collect())
}

#[test]
fn materials_of_options_take_the_place_of_those_of_files() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl cast\nKd 0 0 1\nnewmtl grey\nKd 0.5 0.5 0.5\n");
    folder.write("a.obj", POT);
    let scene = "[material.cast]\ncolour = 'blue'\n[material.grey]\ncolour = 'grey'\n\
                 [[sphere]]\nname = 'lid'\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'cast'\n\
                 [[sphere]]\nname = 'pot/handle'\ncentre = [3, 0, 0]\nradius = 1\nmaterial = 'grey'\n";
    folder.write("a.toml", scene);
    let of = |text: &str| {
        format!("{:?}", kiln::film::Colour::from_u8(kiln::scene::ColourValue::of_text(text).unwrap().0))
    };
    let (red, green) = (of("#f00"), of("#0f0"));
    for name in ["a.obj", "a.toml"] {
        let files = colours(&folder, name, &[]).expect("a scene");
        let given = |options: &[&str]| colours(&folder, name, options).expect("a scene");
        assert!(files[0] != files[1] && !files.contains(&red), "{files:?}");
        assert_eq!(given(&["{ colour = '#f00' }"]), [red.clone(), red.clone()]);
        // By the name of an object, of the parts of an object, and of a material.
        assert_eq!(given(&["lid={ colour = '#f00' }"]), [red.clone(), files[1].clone()]);
        assert_eq!(given(&["pot = { colour = '#f00' }"]), [files[0].clone(), red.clone()]);
        assert_eq!(given(&["grey={ colour = '#f00' }"]), [files[0].clone(), red.clone()]);
        // The last counts, by the names of the files.
        assert_eq!(given(&["{ colour = '#f00' }", "cast={ colour = '#0f0' }"]), [green.clone(), red.clone()]);
        assert_eq!(given(&["cast={ colour = '#0f0' }", "{ colour = '#f00' }"]), [red.clone(), red.clone()]);
        let e = colours(&folder, name, &["lit={ colour = '#f00' }"]).expect_err("no such name");
        assert_eq!(e.to_string(), "--material: no object or material is named `lit`");
        assert!(matches!(&e, Error::Usage { .. }) && e.hint().contains("did you mean `lid`"), "{e:?}");
        for (table, what) in [
            ("{ colour = '#f00', metalic = 1 }", "unknown key `metalic`"),
            ("{}", "missing key `colour`"),
            ("{ colour = '#f00', metallic = 2 }", "`metallic` is 2"),
            ("{ colour = '#f00', shininess = nan }", "`shininess` is NaN"),
        ] {
            let e = colours(&folder, name, &[table]).expect_err(table);
            assert_eq!(e.to_string(), format!("--material {{...}} is not valid: {what}"));
        }
    }
    for text in ["", "red", "lid=red", "#c33"] {
        assert!(MaterialChoice::parse(text).is_err(), "{text}");
    }
    for (text, name, changes) in [
        (" lid = { colour = '#f00' }", Some("lid"), false),
        ("{ colour = '#f00' }", None, false),
        ("a=b {1} += { metallic = 1 }", Some("a=b {1}"), true),
        ("+={ metallic = 1 }", None, true),
    ] {
        let choice = MaterialChoice::parse(text).expect("a choice");
        assert_eq!((choice.name.as_deref(), choice.changes), (name, changes), "{text}");
        assert_eq!(MaterialChoice::parse(&choice.text()), Ok(choice));
    }
}

/// `NAME+={...}` changes single values of the files' materials, whose textures and other values stay. Objects that share
/// a material still do, and those of other names keep it.
#[test]
fn single_values_of_materials_change() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl cast\nKd 0 0 1\nmap_Kd a.png\nPr 0.5\nPm 1\n");
    folder.write("a.png", png(1, &[[255; 4]]));
    folder.write(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nmtllib a.mtl\nusemtl cast\no lid\nf 1/1 2/1 3/1\no rim\nf 1/1 3/1 2/1\no pot\nf 1/1 2/1 3/1\n",
    );
    let load = |options: &[&str]| {
        let materials = options.iter().map(|text| MaterialChoice::parse(text).expect("a choice")).collect();
        load(&folder, "a.obj", &ImportOptions { materials, ..ImportOptions::default() })
    };
    let (scene, _) = load(&["lid+={ roughness = 0.25 }", "rim+={ roughness = 0.25 }"]).expect("a scene");
    let of = |scene: &Scene, i: usize| {
        let Material::MetallicRoughness(m) = &scene.materials[scene.objects[i].material.0 as usize] else {
            panic!("another model")
        };
        assert!(scene.materials[scene.objects[i].material.0 as usize].is_textured());
        (m.name.clone(), m.metallic, m.roughness)
    };
    let [lid, rim, pot] = [0, 1, 2].map(|i| of(&scene, i));
    assert_eq!((&lid, &rim), (&("cast".to_owned(), 1.0, 0.25), &lid));
    assert_eq!(pot, ("cast".to_owned(), 1.0, 0.5));
    // By the name of the material: all three share the changed one.
    let (scene, _) = load(&["cast+={ metallic = 0 }", "lid+={ roughness = 1 }"]).expect("a scene");
    assert_eq!([0, 1, 2].map(|i| of(&scene, i).1), [0.0; 3]);
    assert_eq!([0, 1, 2].map(|i| of(&scene, i).2), [1.0, 0.5, 0.5]);
    assert_eq!(scene.objects[1].material, scene.objects[2].material);
    for (option, what) in
        [("lid+={ metallic = 2 }", "`metallic` is 2"), ("lid+={ shininess = 2 }", "unknown key `shininess`")]
    {
        let e = load(&[option]).expect_err(option);
        assert_eq!(e.to_string(), format!("--material NAME+={{...}} is not valid: {what}"));
    }
}

/// Vertex colours stay, as with `material` of `[[mesh]]`, and a note says so.
#[test]
fn colours_of_vertices_multiply_a_material_of_an_option() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\no scan\nf 1 2 3\n");
    let materials = vec![MaterialChoice::parse("{ colour = 'white' }").expect("a choice")];
    let options = ImportOptions { materials, ..ImportOptions::default() };
    let (scene, warnings) = load(&folder, "a.obj", &options).expect("a scene");
    assert!(scene.objects[0].shape.mesh().is_some_and(|mesh| mesh.colours.is_some()));
    let note = "the colours of the vertices of `scan` multiply that of --material";
    assert!(warnings.notes().iter().any(|said| said == note), "{:?}", warnings.notes());
}

/// `smooth` of a mesh, `--smooth` in its place, and the studio look: the normals of one triangle are there or not.
#[test]
fn meshes_of_scene_files_are_smooth_as_their_keys_and_options_say() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let has_normals = |look: &str, keys: &str, smooths_meshes: bool, option: Option<f64>| {
        folder.write("a.toml", format!("{look}\n[[mesh]]\nfile = 'a.obj'\n{keys}\n"));
        let smooth = option.map(Degrees::clamped);
        let options = ImportOptions { smooth, smooths_meshes, ..ImportOptions::default() };
        let (scene, _) = load(&folder, "a.toml", &options).expect("a scene");
        scene.objects[0].shape.mesh().expect("a mesh").normals.is_some()
    };
    let studio = "[image]\nlook = 'studio'";
    assert!(!has_normals("", "", true, None) && has_normals(studio, "", true, None));
    // `--draft` in place of the look of the file.
    assert!(!has_normals(studio, "", false, None));
    assert!(has_normals("", "smooth = 40", true, None) && !has_normals(studio, "smooth = 0", true, None));
    assert!(
        !has_normals(studio, "smooth = 40", true, Some(0.0))
            && has_normals("", "smooth = 0", true, Some(9.0))
    );
    folder.write("a.toml", "[[mesh]]\nfile = 'a.obj'\nsmooth = 181\n");
    let e = load(&folder, "a.toml", &ImportOptions::default()).expect_err("more than 180 degrees");
    assert!(e.to_string().ends_with("a.toml:3: `smooth` is 181"), "{e}");
}

/// One file with two crease angles is read for each: across its right angle, 100 degrees smooth, 30 do not.
#[test]
fn placements_of_one_file_have_crease_angles_of_their_own() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\n");
    folder.write("a.toml", "[[mesh]]\nfile = 'a.obj'\nsmooth = 30\n[[mesh]]\nfile = 'a.obj'\nsmooth = 100\n");
    let (scene, _) = load(&folder, "a.toml", &ImportOptions::default()).expect("a scene");
    let count =
        |i: usize| scene.objects[i].shape.mesh().and_then(|m| m.normals.as_ref()).unwrap().values.len();
    // Six corners with a normal each, or two shared ones at the edge and two others.
    assert_eq!([count(0), count(1)], [6, 4]);
}

/// `--up` turns the meshes of scene files, in place of their `up`: (0, 0, 1) becomes (0, 1, 0) with z up.
#[test]
fn meshes_of_scene_files_are_turned_by_the_option() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    for (key, option, third) in [
        ("", None, DVec3::Z),
        ("up = 'z'", None, DVec3::Y),
        ("", Some(UpChoice::Axis(UpAxis::Z)), DVec3::Y),
        ("up = 'z'", Some(UpChoice::Axis(UpAxis::Y)), DVec3::Z),
    ] {
        folder.write("a.toml", format!("[[mesh]]\nfile = 'a.obj'\n{key}\n"));
        let options = ImportOptions { up: option, ..ImportOptions::default() };
        let (scene, _) = load(&folder, "a.toml", &options).expect("a scene");
        assert_eq!(scene.objects[0].shape.mesh().expect("a mesh").positions[2], third, "{key} {option:?}");
    }
}

#[test]
fn materials_of_scene_files_are_single_sided_where_they_say_so() {
    let of = |keys: &str| {
        let (scene, _) =
            Folder::new().load("a.toml", format!("[material.a]\ncolour = 'red'\n{keys}\n").as_bytes());
        scene.materials[0].is_single_sided()
    };
    assert!(!of("") && !of("roughness = 1") && !of("double_sided = true"));
    assert!(of("double_sided = false") && of("double_sided = false\nroughness = 1"));
    // Glass bounds a volume.
    assert!(!of("double_sided = false\nlayers = { transmission = 1 }"));
    assert!(!Material::Phong(Phong::default()).is_single_sided());
}

/// A pyramid whose tip is 3 above its base: with z up `auto` turns it, unless it comes with others. Without an option, a
/// note says how.
#[test]
fn meshes_that_stand_upright_are_turned() {
    let folder = Folder::new();
    let pyramid = |up: usize| {
        let corner = |[a, b, h]: [i32; 3]| match up {
            0 => format!("v {h} {b} {a}\n"),
            1 => format!("v {a} {h} {b}\n"),
            _ => format!("v {b} {a} {h}\n"),
        };
        let corners = [[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0], [0, 0, 3]].map(corner).concat();
        format!("{corners}f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n")
    };
    folder.write("y.obj", pyramid(1));
    folder.write("z.obj", pyramid(2));
    let size = |files: &[&str], up: Option<&str>| {
        let up = up.map(|text| UpChoice::parse(text).expect("a choice"));
        let options = ImportOptions { up, ..ImportOptions::default() };
        let files: Vec<_> = files.iter().map(|file| folder.0.path().join(file)).collect();
        let mut warnings = Warnings::default();
        let mut scene = kiln::import::load_with(&files, &options, &mut warnings).expect("a scene");
        scene.objects.truncate(1);
        let (min, max) = scene.bounds().expect("bounds");
        (max - min, warnings.notes().concat())
    };
    let [standing, lying] = [DVec3::new(2.0, 3.0, 2.0), DVec3::new(2.0, 2.0, 3.0)];
    let (turned, note) = size(&["z.obj"], Some("AUTO"));
    assert!(
        turned == standing && note.contains("z.obj: stands upright with z up") && note.contains("--up y")
    );
    let (kept, note) = size(&["z.obj"], None);
    assert!(kept == lying && note.contains("--up z turns it, --up auto all such files"), "{note}");
    assert_eq!(size(&["y.obj"], Some("auto")), (standing, String::new()));
    assert_eq!(size(&["y.obj"], None), (standing, String::new()));
    assert_eq!(size(&["z.obj"], Some("y")), (lying, String::new()));
    let (kept, note) = size(&["z.obj", "y.obj"], Some("auto"));
    assert!(kept == lying && note.ends_with("--up z turns it"), "{note}");
    // `auto` turns no file to another axis than z.
    folder.write("x.obj", pyramid(0));
    for up in [None, Some("auto")] {
        let (kept, note) = size(&["x.obj"], up);
        assert!(kept == DVec3::new(3.0, 2.0, 2.0) && note.ends_with("--up x turns it"), "{note}");
    }
    for (up, expected) in [("Z", lying), ("-y", standing), ("-X", DVec3::new(3.0, 2.0, 2.0))] {
        assert_eq!(size(&["y.obj"], Some(up)).0, expected, "{up}");
    }
}

/// Hidden objects are not in the scene: it is that of a file without them, whose automatic camera frames the others.
/// Materials keep the names of hidden objects.
#[test]
fn hidden_objects_are_not_in_the_scene() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 0 0\no lid\nf 1 2 3\no pot\nf 1 4 3\n");
    let load = |hide: &[&str], isolate: &[&str]| {
        let list = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let materials = vec![MaterialChoice::parse("pot={ colour = '#f00' }").expect("a choice")];
        let (hide, isolate) = (list(hide), list(isolate));
        load(&folder, "a.obj", &ImportOptions { hide, isolate, materials, ..ImportOptions::default() })
    };
    for (hide, isolate) in [(&["pot"][..], &[][..]), (&[], &["lid"])] {
        let (scene, _) = load(hide, isolate).expect("a scene");
        assert_eq!(scene.objects.len(), 1);
        assert_eq!(scene.bounds().expect("bounds").1, DVec3::new(1.0, 1.0, 0.0));
    }
    let e = load(&["lit"], &[]).expect_err("no such name");
    assert_eq!(e.to_string(), "--hide: no object is named `lit`");
    assert!(matches!(&e, Error::Usage { .. }) && e.hint().contains("did you mean `lid`"), "{e:?}");
    let e = load(&["lid", "pot"], &[]).expect_err("nothing is left");
    assert_eq!(e.to_string(), "--hide leaves no object in the picture");
}

/// A mesh of two parts turns about the centre of both, whether or not one of them is hidden; tracks of hidden objects
/// alone move nothing.
#[test]
fn tracks_move_the_parts_that_are_left_as_before() {
    let folder = Folder::new();
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 0 0\no lid\nf 1 2 3\no pot\nf 1 4 3\n");
    folder.write(
        "a.toml",
        "[[mesh]]\nname = 'kettle'\nfile = 'a.obj'\n[[sphere]]\nname = 'ball'\ncentre = [0, 5, 0]\nradius = 1\n\
         [animation]\nfps = 4\nduration = 1\n\
         [[animation.track]]\nobject = 'kettle'\nproperty = 'rotate'\n\
         keyframes = [{ time = 0, value = [0, 0, 0] }, { time = 1, value = [0, 90, 0] }]\n\
         [[animation.track]]\nobject = 'ball'\nproperty = 'radius'\n\
         keyframes = [{ time = 0, value = 1 }, { time = 1, value = 2 }]\n",
    );
    let at = |hide: &[&str]| {
        let hide = hide.iter().map(|&name| name.to_owned()).collect();
        let options = ImportOptions { hide, ..ImportOptions::default() };
        load(&folder, "a.toml", &options).expect("a scene").0.at(1.0).expect("a moment").objects
    };
    let (all, some) = (at(&[]), at(&["kettle/pot", "ball"]));
    assert_eq!((all.len(), some.len()), (3, 1));
    let positions =
        |objects: &[kiln::scene::Object]| objects[0].shape.mesh().expect("a mesh").positions.clone();
    assert_eq!(positions(&some), positions(&all));
    // The lid turns about x = 4.5, the centre of both parts, to z = 4.5: alone it would turn about its own centre.
    assert!(positions(&some).iter().any(|p| (p.z - 4.5).abs() < 1e-9 && (p.x - 4.5).abs() < 1e-9));
}
