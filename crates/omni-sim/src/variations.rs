//! Changed copies of a building, for tests that ask what a robot may depend on: not on ids, but very much on things being
//! there.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::building::Building;
use crate::mesh::TriangleMesh;

impl Building {
    /// The same building with all object ids dealt out anew. Geometry, order of triangles and captions stay.
    pub fn with_permuted_ids(&self, seed: u64) -> Building {
        let mut ids: Vec<u32> = self.objects.iter().map(|o| o.id).collect();
        ids.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let new_id = |old: u32| match self.objects.binary_search_by_key(&old, |o| o.id) {
            Ok(index) => ids[index],
            Err(_) => old, // the structure
        };
        let mut copy = self.clone();
        for object in &mut copy.objects {
            object.id = new_id(object.id);
            object.supported_by = object.supported_by.map(new_id);
            object.placed_with = object.placed_with.map(new_id);
        }
        copy.objects.sort_by_key(|o| o.id);
        copy.mesh.instances.iter_mut().for_each(|i| *i = new_id(*i));
        for mover in &mut copy.movers {
            mover.instance = new_id(mover.instance);
            mover.mesh.instances.iter_mut().for_each(|i| *i = new_id(*i));
        }
        copy
    }

    /// The same building without these objects and what stands on them. Unknown ids are ignored.
    pub fn without_objects(&self, ids: &[u32]) -> Building {
        let gone = |id: u32| {
            let mut at = Some(id);
            while let Some(current) = at {
                if ids.contains(&current) {
                    return true;
                }
                at = self.object(current).and_then(|o| o.supported_by);
            }
            false
        };
        let mut copy = self.clone();
        copy.objects.retain(|o| !gone(o.id));
        for object in &mut copy.objects {
            object.placed_with = object.placed_with.filter(|id| !gone(*id));
        }
        copy.movers.retain(|m| !gone(m.instance));
        copy.mesh = filtered(&self.mesh, |instance| !gone(instance));
        copy
    }
}

/// The triangles whose instance is kept, with the vertices they use in the old order.
fn filtered(mesh: &TriangleMesh, keep: impl Fn(u32) -> bool) -> TriangleMesh {
    let mut out = TriangleMesh::default();
    let mut new_index = vec![u32::MAX; mesh.vertices.len()];
    let mut last = (0, true); // triangles of an object follow each other
    for (k, face) in mesh.faces.iter().enumerate() {
        let instance = mesh.instances[k];
        if instance != last.0 {
            last = (instance, keep(instance));
        }
        if instance != 0 && !last.1 {
            continue;
        }
        let corners = face.map(|v| {
            let v = v as usize;
            if new_index[v] == u32::MAX {
                new_index[v] = out.vertices.len() as u32;
                out.vertices.push(mesh.vertices[v]);
            }
            new_index[v]
        });
        out.faces.push(corners);
        out.instances.push(instance);
        out.colors.push(mesh.colors[k]);
    }
    out
}

#[cfg(test)]
mod tests {
    use crate::scenes::named_scene;

    #[test]
    fn removing_a_table_removes_what_stands_on_it() {
        let b = named_scene("spin").expect("a named scene");
        let on = b.objects.iter().find(|o| o.supported_by.is_some()).expect("something stands on something");
        let table = on.supported_by.expect("found by it");
        let less = b.without_objects(&[table]);
        assert!(less.object(table).is_none() && less.object(on.id).is_none());
        assert!(less.mesh.instances.iter().all(|i| *i != table && *i != on.id));
        let count = |i: u32| b.mesh.instances.iter().filter(|x| **x == i).count();
        let gone: usize = b.objects.iter().filter(|o| less.object(o.id).is_none()).map(|o| count(o.id)).sum();
        assert_eq!(less.mesh.faces.len(), b.mesh.faces.len() - gone);
    }

    #[test]
    fn permuted_ids_move_with_their_triangles() {
        let b = named_scene("flat").expect("a named scene");
        let p = b.with_permuted_ids(5);
        assert!(p.objects.windows(2).all(|w| w[0].id < w[1].id));
        for old in &b.objects {
            let new = p
                .objects
                .iter()
                .find(|o| o.bounds == old.bounds && o.caption == old.caption)
                .expect("it is still there");
            let count = |m: &crate::mesh::TriangleMesh, i: u32| m.instances.iter().filter(|x| **x == i).count();
            assert_eq!(count(&b.mesh, old.id), count(&p.mesh, new.id));
        }
    }
}
