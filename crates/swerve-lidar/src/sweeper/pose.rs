//! Sensor poses at the instants of columns.

use super::firing::{Firing, Piece};
use super::pattern::{Column, Pattern};
use crate::scene_tree::SceneTree;
use crate::scene_tree::flat::ColumnPose;

/// Sensor pose at a column's instant: origin, and rotation from its frame, row by row.
struct SensorPose {
    origin_m: [f64; 3],
    rotation: [[f64; 3]; 3],
}

impl SensorPose {
    /// Pose at an instant: interpolated position, and rotation by normalised linear interpolation of the quaternions,
    /// whose error within one step is negligible.
    fn at(firing: &Firing, at_ns: i64) -> Self {
        let Firing { begin_ns, begin, end_ns, end, .. } = firing;
        let since = |ns: i64| ns as f64 - *begin_ns as f64;
        let share = since(at_ns) / since(*end_ns).max(1.0);
        let (from, to) = (begin.origin().coords, end.origin().coords);
        let origin_m = [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        let (from, to) = (begin.rotation(), end.rotation());
        let sign_share = if from.coords.dot(&to.coords) < 0.0 { -share } else { share };
        let mixed = [0, 1, 2, 3].map(|k| (1.0 - share) * from.coords[k] + sign_share * to.coords[k]);
        let [x, y, z, w] = mixed;
        let scale = 1.0 / (x * x + y * y + z * z + w * w).sqrt();
        let [x, y, z, w] = mixed.map(|q| q * scale);
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self { origin_m, rotation }
    }
}

impl Pattern {
    /// Pose of a column in the tree frame.
    pub(super) fn column_pose(&self, tree: &SceneTree, firing: &Firing, column: u32) -> ColumnPose {
        self.column_pose_from(tree, &SensorPose::at(firing, self.columns[column as usize].at_ns), column)
    }

    /// Poses of the columns of a piece in the tree frame.
    pub(crate) fn column_poses(&self, tree: &SceneTree, piece: &Piece) -> impl Iterator<Item = ColumnPose> {
        let firing = &piece.firing;
        // A sensor at rest has one pose for all columns.
        let rest = (firing.begin == firing.end).then(|| SensorPose::at(firing, firing.begin_ns));
        piece.columns.clone().map(move |column| match &rest {
            Some(pose) => self.column_pose_from(tree, pose, column),
            None => self.column_pose(tree, firing, column),
        })
    }

    fn column_pose_from(&self, tree: &SceneTree, pose: &SensorPose, column: u32) -> ColumnPose {
        let Column { azimuth: [sin, cos], .. } = self.columns[column as usize];
        let matrix =
            pose.rotation.map(|[x, y, z]| [(x * cos + y * sin) as f32, (y * cos - x * sin) as f32, z as f32]);
        ColumnPose { origin: tree.local(pose.origin_m), matrix }
    }
}
