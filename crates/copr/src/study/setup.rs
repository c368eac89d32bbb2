//! Where images, anchors, targets and queries are: figure 6.2.

use vpr_core::{Definition, Pose, Poses, Provenance};
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

use super::{Context, Paths, Rooms, Scene};
use crate::{Anchors, Grid, PoseErrors, Result, Targets, oracle, sequences};

pub(super) fn run(
    table: &mut Table,
    scenes: &[Scene],
    (step_m, rooms): (f64, &Rooms),
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    for encoder in &rooms.encoders {
        for scene in scenes {
            let room = match rooms.open(scene, encoder, Paths::Own, context)? {
                Ok(room) => room,
                Err(why) => {
                    table.push(Cell::absent("images", &scene.name, why));
                    continue;
                }
            };
            let queries = room.queries.map.poses().six_dof()?;
            let kept = &room.references.map.poses().six_dof()?[room.kept.clone()];
            let one = sequences(None, kept.len());
            let sides = (queries, kept);
            let anchors = Anchors::every_and_last(kept, &one, rooms.every)?;
            let left_out: Vec<usize> =
                (0..kept.len()).filter(|it| anchors.rows().binary_search(it).is_err()).collect();
            let targets = Targets::frames(&anchors, kept, &left_out)?;
            let shown = Shown { name: &scene.name, kind: "interpolation", sides };
            shown.push((table, &mut figure), &anchors, &targets, false)?;
            let anchors = Anchors::every(kept, &one, rooms.every)?;
            let grid = Grid::new(scene.span_m, step_m, Definition::Corrected)?;
            let targets = Targets::around(&anchors, &grid)?;
            let shown = Shown { name: &scene.name, kind: "extrapolation", sides };
            shown.push((table, &mut figure), &anchors, &targets, true)?;
        }
    }
    Ok(figure)
}

/// One panel.
struct Shown<'a> {
    name: &'a str,
    kind: &'a str,
    /// Queries and images of the map.
    sides: (&'a [Pose], &'a [Pose]),
}

impl Shown<'_> {
    /// `whole` says whether images that are no anchors stay in the map.
    fn push(
        &self,
        (table, figure): (&mut Table, &mut Figure),
        anchors: &Anchors,
        targets: &Targets<'_>,
        whole: bool,
    ) -> Result<()> {
        let (queries, images) = self.sides;
        let column = format!("{}, {}", self.name, self.kind);
        let planar = |poses: &[Pose]| -> Vec<(f64, f64)> {
            poses.iter().map(|it| (it.translation.x, it.translation.y)).collect()
        };
        let at: Vec<Pose> = targets.iter().map(|it| it.pose).collect();
        let sparse = if whole { images } else { anchors.poses() };
        let is_plain = |row: &usize| anchors.rows().binary_search(row).is_err();
        let plain: Vec<Pose> = (0..images.len()).filter(is_plain).map(|row| images[row]).collect();
        let mut lists: Vec<(&str, &[Pose])> = vec![("targets", &at)];
        if whole {
            lists.push(("images that are no anchors", &plain));
        }
        lists.extend([("anchors", anchors.poses()), ("queries", queries)]);
        for (name, n) in [
            ("queries", queries.len()),
            ("images", images.len()),
            ("anchors", anchors.len()),
            ("images that are no anchors and stay", if whole { plain.len() } else { 0 }),
            ("targets", targets.len()),
        ] {
            table.push(Cell::new(name, &column, n as f64, Provenance::Generated, n));
        }
        let queries = Poses::SixDof(queries.to_vec());
        let dense = [sparse, &at].concat();
        for (map, poses) in [("sparse map", sparse.to_vec()), ("dense map", dense)] {
            let poses = Poses::SixDof(poses);
            let best = oracle(&queries, &poses)?;
            let errors = PoseErrors::of_retrieval(&best, &poses, &queries)?;
            let far = vpr_core::metrics::median(&errors.translation_m)?;
            let row = format!("median distance to the nearest pose of the {map}, m");
            table.push(Cell::new(row, &column, far, Provenance::Generated, errors.len()));
        }
        let curve = |(name, poses): (&str, &[Pose])| {
            Curve::new(name, planar(poses)).of(Provenance::Generated).shaped(Shape::Points)
        };
        figure.panels.push(Panel {
            title: column,
            x_label: "x, m".to_owned(),
            y_label: "y, m".to_owned(),
            curves: lists.into_iter().map(curve).collect(),
            ..Panel::default()
        });
        Ok(())
    }
}
