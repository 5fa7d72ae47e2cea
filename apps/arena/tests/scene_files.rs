//! Buildings written as OBJ and glTF are the same when they are read again; what is no scene is refused and nothing panics.

#[path = "support/scene_writer.rs"]
mod scene_writer;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use arena::buildings::{Buildings, Turns};
use arena::omni_sim::building::{Building, BuildingConfig, generate};
use arena::omni_sim::cooccurrence::Cooccurrence;
use arena::omni_sim::imported::NamedMesh;
use arena::omni_sim::scenes::named_scene;
use arena::scenario::Scene;
use arena::scene_error::SceneError;
use arena::scene_file::{building_of, read_scene};
use arena::scene_gltf::read_gltf;
use arena::scene_obj::read_obj;
use mission::robot_model::RobotModel;
use proptest::prelude::*;
use scene_writer::{Kept, parts_of, write_gltf, write_obj};

/// Nothing is beside the scene.
fn nothing(name: &str) -> Result<Vec<u8>, SceneError> {
    Err(SceneError::Open { name: name.to_owned(), source: std::io::ErrorKind::NotFound.into() })
}

fn through_obj(building: &Building, with_rooms: bool) -> Vec<NamedMesh> {
    let (obj, mtl) = write_obj(&parts_of(building, with_rooms));
    let open = |name: &str| if name == "colors.mtl" { Ok(mtl.clone().into_bytes()) } else { nothing(name) };
    read_obj(obj.as_bytes(), &open).expect("we wrote it")
}

fn through_gltf(building: &Building, with_rooms: bool, kept: Kept) -> Vec<NamedMesh> {
    read_gltf(&write_gltf(&parts_of(building, with_rooms), kept), &nothing).expect("we wrote it")
}

/// Same things in the same rooms on the same supports at the same places.
fn assert_same(before: &Building, after: &Building) {
    let names = |b: &Building| b.rooms.iter().map(|r| r.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(before), names(after));
    for (a, b) in before.rooms.iter().zip(&after.rooms) {
        // Cells of 5 cm, and half of every doorway.
        assert!((a.area_m2() - b.area_m2()).abs() < 0.06 * a.area_m2() + 0.3, "{} {}", a.area_m2(), b.area_m2());
        assert_eq!(a.kind, b.kind);
    }
    let doors = |b: &Building| {
        let mut doors: Vec<(u32, u32)> = b.doors.iter().map(|d| d.rooms).collect();
        doors.sort_unstable();
        doors
    };
    assert_eq!(doors(before), doors(after));
    for a in &before.doors {
        let widths: Vec<f64> = after.doors.iter().filter(|b| b.rooms == a.rooms).map(|b| b.width_m).collect();
        assert!(widths.iter().any(|w| (w - a.width_m).abs() < 0.11), "{} and {widths:?}", a.width_m);
    }
    assert_eq!(before.objects.len(), after.objects.len());
    let shift = after.objects[0].bounds.min - before.objects[0].bounds.min;
    let mut same_support = 0;
    for (a, b) in before.objects.iter().zip(&after.objects) {
        assert_eq!((&a.class, &a.color, a.room), (&b.class, &b.color, b.room), "{a:?}\n{b:?}");
        assert!(
            (a.bounds.min + shift - b.bounds.min).norm() < 1e-3 && (a.bounds.max + shift - b.bounds.max).norm() < 1e-3
        );
        same_support += usize::from(a.supported_by == b.supported_by);
    }
    assert_eq!(same_support, before.objects.len(), "everything rests on what it rested on");
}

#[test]
fn a_building_is_the_same_through_obj_and_gltf() {
    for building in [named_scene("flat").unwrap(), named_scene("office").unwrap()] {
        assert_same(&building, &building_of(&through_obj(&building, true)).unwrap());
        for kept in [Kept::Embedded, Kept::Binary] {
            assert_same(&building, &building_of(&through_gltf(&building, true, kept)).unwrap());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn any_building_is_the_same_through_gltf(seed in 0..1000_u64, rooms in 2..8_u32) {
        let building = generate(&BuildingConfig { seed, rooms, ..BuildingConfig::default() }).unwrap();
        assert_same(&building, &building_of(&through_gltf(&building, true, Kept::Binary)).unwrap());
    }
}

#[test]
fn without_volumes_the_rooms_are_cut_and_named_by_what_is_in_them() {
    let building = named_scene("flat").unwrap();
    let again = building_of(&through_obj(&building, false)).unwrap();
    assert_eq!(building.rooms.len(), again.rooms.len());
    let count = |b: &Building| {
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        b.rooms.iter().for_each(|r| *count.entry(r.kind.name()).or_default() += 1);
        count.into_iter().map(|(name, n)| (name.to_owned(), n)).collect::<BTreeMap<String, usize>>()
    };
    assert_eq!(count(&building), count(&again));
}

#[test]
fn y_up_and_z_up_obj_are_the_same_building() {
    let building = named_scene("spin").unwrap();
    let mut parts = parts_of(&building, true);
    let (z_up, mtl) = write_obj(&parts);
    for corner in parts.iter_mut().flat_map(|p| &mut p.triangles).flat_map(|(corners, _)| corners) {
        *corner = [corner[0], corner[2], -corner[1]];
    }
    let (y_up, _) = write_obj(&parts);
    let read = |obj: &str| building_of(&read_obj(obj.as_bytes(), &|_| Ok(mtl.clone().into_bytes())).unwrap()).unwrap();
    let (a, b) = (read(&z_up), read(&y_up));
    assert_eq!(a.rooms, b.rooms);
    assert_eq!(a.objects, b.objects);
}

#[test]
fn a_scene_is_opened_by_its_file_and_what_is_wrong_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let building = named_scene("flat").unwrap();
    let (obj, mtl) = write_obj(&parts_of(&building, true));
    fs::write(at("flat.obj"), &obj).unwrap();
    let robot = RobotModel::builtin_quadruped();
    let open = |name: &str| Scene::open(at(name).to_str().unwrap(), &robot).map(|s| s.building);
    let error = |name: &str| format!("{:#}", open(name).unwrap_err());
    assert!(error("flat.obj").contains("colors.mtl cannot be opened"), "{}", error("flat.obj"));
    fs::write(at("colors.mtl"), &mtl).unwrap();
    assert_same(&building, &open("flat.obj").unwrap());
    fs::write(at("flat.glb"), write_gltf(&parts_of(&building, true), Kept::Binary)).unwrap();
    assert_same(&building, &open("flat.glb").unwrap());

    fs::write(at("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 999999999999\n").unwrap();
    assert!(error("bad.obj").contains("line 3") && error("bad.obj").contains("bad.obj"), "{}", error("bad.obj"));
    fs::write(at("out.obj"), "mtllib ../../etc/passwd\n").unwrap();
    assert!(error("out.obj").contains("only files beside the scene"), "{}", error("out.obj"));
    fs::write(at("empty.gltf"), "{}").unwrap();
    assert!(error("empty.gltf").contains("a scene with a list of nodes"), "{}", error("empty.gltf"));
    fs::write(at("circle.gltf"), r#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[0]}]}"#).unwrap();
    assert!(error("circle.gltf").contains("nodes[0]"), "{}", error("circle.gltf"));
    let huge = r#"{"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":1000000000}],
        "bufferViews":[{"buffer":0,"byteLength":3}],"buffers":[{"uri":"data:;base64,AAAA"}]}"#;
    fs::write(at("huge.gltf"), huge).unwrap();
    assert!(error("huge.gltf").contains("accessors[0]"), "{}", error("huge.gltf"));
    fs::write(at("noise.png"), [7; 100]).unwrap();
    assert!(error("noise.png").contains("noise.png"), "{}", error("noise.png"));
    assert!(error("missing.glb").contains("missing.glb"));
    assert!(matches!(read_scene(Path::new("/nowhere.obj")), Err(SceneError::Open { .. })));
}

/// Bytes of a small scene with some of them changed, cut or repeated.
fn mutated(original: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let changes = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4_u8), 1..12);
    changes.prop_map(move |changes| {
        let mut bytes = original.clone();
        for (at, byte, how) in changes {
            let at = at.index(bytes.len().max(1));
            match how {
                0 if at < bytes.len() => bytes[at] = byte,
                1 if at < bytes.len() => drop(bytes.remove(at)),
                2 => bytes.insert(at, b"0123456789e-.,[]{}\" \n"[usize::from(byte) % 20]),
                _ => bytes.truncate(at.max(bytes.len() / 2)),
            }
        }
        bytes
    })
}

fn little() -> Vec<scene_writer::Part> {
    parts_of(&named_scene("narrow-door").unwrap(), true).into_iter().filter(|p| p.triangles.len() < 60).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_mutated_obj_panics(bytes in mutated(write_obj(&little()).0.into_bytes())) {
        if let Ok(meshes) = read_obj(&bytes, &|_| Ok(Vec::new())) { let _ = building_of(&meshes); }
    }

    #[test]
    fn no_mutated_gltf_panics(bytes in mutated(write_gltf(&little(), Kept::Embedded))) {
        if let Ok(meshes) = read_gltf(&bytes, &nothing) { let _ = building_of(&meshes); }
    }

    #[test]
    fn no_mutated_glb_panics(bytes in mutated(write_gltf(&little(), Kept::Binary))) {
        if let Ok(meshes) = read_gltf(&bytes, &nothing) { let _ = building_of(&meshes); }
    }
}

#[test]
fn real_floor_plans_become_buildings_and_mixed_sets_take_turns() {
    let plans = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/rooms");
    if !plans.is_dir() {
        eprintln!("skipped: {} is not there", plans.display());
        return;
    }
    let robot = RobotModel::builtin_quadruped();
    let buildings = Buildings::new(Cooccurrence::Usual, Turns::Mixed, &[plans]).unwrap();
    for index in 0..6 {
        let draw = || {
            let mut seed = 40 + index as u64;
            let mut next = || {
                seed += 1;
                seed
            };
            buildings.draw(index, 5, &robot, &mut next).unwrap()
        };
        let (a, b) = (draw(), draw());
        assert_eq!((&a.name, &a.building.objects), (&b.name, &b.building.objects));
        assert_eq!(a.name.contains(".png#"), index % 2 == 1, "{}", a.name);
        assert!(a.building.rooms.len() >= 2 && a.building.objects.len() > 10);
        // The name opens the same kind of building again; of how many rooms is drawn from the seed.
        let again = Scene::open(&a.name, &robot).unwrap();
        assert_eq!(again.name, a.name);
    }
}
