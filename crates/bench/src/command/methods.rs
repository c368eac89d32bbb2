//! `bench methods`: which techniques of the thesis run here, which networks there are, what they need,
//! and where their weights are from.

use std::path::PathBuf;

use vpr_nets::encode::{
    Interpolation, Size,
    registry::{Architecture, Method, methods},
};
use vpr_report::cli::{self, DataArgs, Outcome};
use vpr_study::{Technique, technique::hand_crafted};

/// Say which of the ten techniques of the thesis run here, which networks there are, or everything about
/// one network.
#[derive(clap::Args)]
pub(crate) struct MethodsArgs {
    /// The one to tell everything about
    name: Option<String>,
    #[command(flatten)]
    data: DataArgs,
}

pub(crate) fn run(args: &MethodsArgs) -> anyhow::Result<Outcome> {
    let roots = args.data.folders();
    let text = if let Some(name) = &args.name {
        everything(&Method::find(name, None)?, &roots)
    } else {
        let mut text = "the ten techniques of the thesis\n".to_owned();
        for technique in Technique::ALL {
            text += &of_the_thesis(technique, &roots)?;
        }
        text += "\nnetworks\n";
        text.extend(methods().iter().map(|method| line(method, &roots)));
        text
    };
    cli::print(&text)?;
    Ok(Outcome::Success)
}

/// Whether a technique of chapter 3 runs here, and else where its weights are from.
fn of_the_thesis(technique: Technique, roots: &[PathBuf]) -> anyhow::Result<String> {
    let name = technique.typed_name();
    let state = if hand_crafted(name).is_some() {
        "runs here".to_owned()
    } else {
        let method = Method::find(name, None)?;
        let dimension = method.dimensions[0];
        match method.locate(dimension, roots) {
            Some(_) => "runs here".to_owned(),
            None => {
                format!("weights absent: {}, {}", method.file(dimension), method.origin(dimension))
            }
        }
    };
    Ok(format!("{:<12}{name:<14}{state}\n", technique.name()))
}

fn line(method: &Method, roots: &[PathBuf]) -> String {
    let dimension = method.dimensions[0];
    let at_hand = method.dimensions.iter().any(|&it| method.locate(it, roots).is_some());
    let state = match at_hand {
        _ if is_built_in(method) => "built in",
        true => "at hand",
        false => "absent",
    };
    let (name, backbone) = (&method.name, &method.backbone);
    format!("{name:<26}{backbone:<20}{dimension:>6}  {state:<9}{}\n", method.paper)
}

/// Whether its weights are part of the program, wherever else they lie.
fn is_built_in(method: &Method) -> bool {
    method.architecture == Architecture::Default
}

fn everything(method: &Method, roots: &[PathBuf]) -> String {
    let dimensions: Vec<_> = method.dimensions.iter().map(ToString::to_string).collect();
    let dimension = method.dimensions[0];
    let place =
        method.locate(dimension, roots).map_or("absent".to_owned(), |place| place.to_string());
    let place = match &*place {
        "built in" => place,
        file if is_built_in(method) => format!("built in, and {file}, which is used"),
        _ => place,
    };
    let preprocessing = method.preprocessing();
    let size = match preprocessing.size {
        Size::Fixed { height, width } => format!("height {height}, width {width}"),
        Size::ShorterSide(side) => format!("shorter side {side}"),
        Size::Native => "as they are".to_owned(),
        Size::NativeMultipleOf(step) => format!("as they are, to multiples of {step}"),
    };
    let filter = match preprocessing.interpolation {
        Interpolation::BilinearOpenCv => "bilinear without antialiasing, as OpenCV",
        Interpolation::BicubicOpenCv => "bicubic without antialiasing, as OpenCV",
        Interpolation::Bilinear => "bilinear with antialiasing, as Pillow",
        Interpolation::Bicubic => "bicubic with antialiasing, as Pillow",
        Interpolation::Nearest => "nearest",
    };
    let order = if preprocessing.resize_after_normalize { "after" } else { "before" };
    let (mean, std) = (preprocessing.mean, preprocessing.std);
    let rows = [
        ("paper", method.paper.clone()),
        ("backbone", method.backbone.clone()),
        ("dimensions", dimensions.join(", ")),
        ("images", format!("{size}; {filter}; resized {order} normalisation")),
        ("input", format!("{:?}, mean {mean:?}, std {std:?}", preprocessing.channels)),
        ("weights", method.file(dimension)),
        ("origin", method.origin(dimension)),
        ("licence", method.licence.clone().unwrap_or_else(|| "none stated".to_owned())),
        ("digest", method.digest.clone().unwrap_or_else(|| "not known".to_owned())),
        ("at hand", place),
        ("checked", method.checked.clone()),
    ];
    let lines: Vec<_> = rows.iter().map(|(key, value)| format!("{key:<12}{value}\n")).collect();
    lines.concat()
}
