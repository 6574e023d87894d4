//! Trees over instances, whose shapes have separate trees.

use swerve_scene::vector::{dot, sub};
use swerve_scene::{Instance, MeshId, MeshLibrary, SemanticClass};
use wide::f32x8;

use super::shape::{CachedShape, Pose};
use crate::bvh::{Builder, Bvh, LANES, Packet, Ray, Stack};
use crate::soup::TriangleHit;

/// State of a packet's traversal other than the rays.
pub(crate) struct Query<'a> {
    pub(crate) reach: &'a mut f32x8,
    pub(crate) hidden: Option<u32>,
    pub(crate) stacks: &'a mut [Stack; 2],
}

/// Instance in a tree of instances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedInstance {
    pub(crate) pose: Pose,
    pub(crate) mesh: MeshId,
    pub(crate) instance_id: u32,
    pub(crate) class: SemanticClass,
}

/// Tree over instances.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceTree {
    pub(crate) bvh: Bvh,
    /// Instances in leaf order.
    pub(crate) placed: Vec<PlacedInstance>,
    pub(crate) unsorted: Vec<PlacedInstance>,
}

impl InstanceTree {
    /// Builds the tree over instances.
    pub(crate) fn build<'a>(
        &mut self,
        instances: impl Iterator<Item = &'a Instance>,
        meshes: &MeshLibrary,
        centre_m: [f64; 3],
        builder: &mut Builder,
    ) {
        self.unsorted.clear();
        builder.boxes.clear();
        for instance in instances {
            let pose = Pose::new(&instance.map_from_body, centre_m);
            builder.boxes.push(pose.bounds(meshes.get(instance.mesh).bounds()));
            let (mesh, instance_id, class) = (instance.mesh, instance.instance_id, instance.class);
            self.unsorted.push(PlacedInstance { pose, mesh, instance_id, class });
        }
        builder.build(&mut self.bvh, 1);
        self.placed.clear();
        self.placed.extend(builder.leaves().map(|items| self.unsorted[items[0] as usize]));
    }

    /// Nearest triangle hit, and its instance.
    pub(crate) fn nearest(
        &self,
        ray: &Ray,
        shapes: &[CachedShape],
        reach: f32,
        hidden: Option<u32>,
        stacks: &mut [Stack; 2],
    ) -> Option<(u32, TriangleHit)> {
        let mut found = None;
        let [outer, inner] = stacks;
        self.bvh.walk(ray, reach, outer, |leaf, reach| {
            let placed = &self.placed[leaf as usize];
            if hidden == Some(placed.instance_id) {
                return reach;
            }
            let (origin, direction) = ray.parts();
            let from = sub(origin, placed.pose.origin);
            let [x, y, z] = placed.pose.axes;
            let rotate = |v: [f32; 3]| [dot(x, v), dot(y, v), dot(z, v)];
            let local = Ray::new(rotate(from), rotate(direction));
            match shapes[placed.mesh.index()].shape.soup.nearest(&local, reach, inner, |_| true) {
                Some(met) if met.distance < reach || found.is_none_or(|(other, _)| leaf < other) => {
                    found = Some((leaf, met));
                    met.distance
                }
                _ => reach,
            }
        });
        found
    }

    /// As [`Self::nearest`] for a packet of rays; shortens their reach and writes nearer hits to `found`.
    pub(crate) fn nearest_packet(
        &self,
        packet: &Packet,
        shapes: &[CachedShape],
        query: &mut Query<'_>,
        found: &mut [Option<(u32, TriangleHit)>; LANES],
    ) {
        let [outer, inner] = query.stacks;
        let hidden = query.hidden;
        self.bvh.walk_packet(packet, query.reach, outer, |leaf, rays, reach| {
            let placed = &self.placed[leaf as usize];
            if hidden == Some(placed.instance_id) {
                return;
            }
            let local = placed.pose.local(packet);
            // Rays that miss the box are deactivated by a negative reach.
            let mut local_reach = [-1.0; LANES];
            let before = reach.to_array();
            for ray in 0..LANES {
                if rays >> ray & 1 != 0 {
                    local_reach[ray] = before[ray];
                }
            }
            let mut local_reach = f32x8::new(local_reach);
            let soup = &shapes[placed.mesh.index()].shape.soup;
            let met = soup.nearest_packet(&local, &mut local_reach, inner, |_| true);
            let reaches = reach.as_mut_array();
            for ray in 0..LANES {
                if let Some(met) = met[ray]
                    && (met.distance < reaches[ray] || found[ray].is_none_or(|(other, _)| leaf < other))
                {
                    reaches[ray] = met.distance;
                    found[ray] = Some((leaf, met));
                }
            }
        });
    }
}
