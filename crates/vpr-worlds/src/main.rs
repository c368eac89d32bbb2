//! The `worlds` program: lists, renders and previews generated places.

use std::{
    io::Cursor,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context;
use clap::{Args as ClapArgs, Parser, Subcommand};
use image::ImageFormat;
use vpr_data::DataRoots;
use vpr_files::replace;
use vpr_report::cli::{self, Outcome};
use vpr_worlds::{Recipe, World, names, preview, recipe_with};

/// Generated places with exact poses and quantified nuisances.
#[derive(Parser)]
#[command(version, about, propagate_version = true)]
struct Args {
    /// Folder of the datasets: rooms follow the published camera paths of 7-Scenes if it has them
    #[arg(long, env = "VPR_DATA", value_name = "DIR", default_value = "data", global = true)]
    data: PathBuf,
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    quiet: cli::Quiet,
}

#[derive(Subcommand)]
enum Command {
    /// List the worlds, one a line: name, places, layout, counterpart
    List,
    /// Render worlds into the cache and print their folders
    Render {
        #[command(flatten)]
        which: Which,
        /// Folder that keeps rendered worlds
        #[arg(long, env = "VPR_CACHE", value_name = "DIR", default_value = "data/worlds")]
        cache: PathBuf,
    },
    /// Write a contact sheet of references and queries side by side
    Preview {
        #[command(flatten)]
        which: Which,
        /// The PNG to write
        #[arg(long, short, value_name = "FILE", default_value = "preview.png")]
        output: PathBuf,
        /// Number of queries on the sheet
        #[arg(long, value_name = "N", default_value_t = 9)]
        queries: usize,
    },
    #[command(flatten)]
    Shell(cli::Shell),
}

#[derive(ClapArgs)]
struct Which {
    /// A name as `world/street`, or the path of a recipe
    #[arg(value_name = "WORLD")]
    world: String,
    /// Set a key of the recipe, as `queries.condition.darkness=0.5`
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
}

impl Which {
    fn recipe(&self, roots: &DataRoots) -> anyhow::Result<Recipe> {
        let pairs = self.settings.iter().map(|setting| {
            setting.split_once('=').with_context(|| format!("`{setting}` is not KEY=VALUE"))
        });
        let settings: Vec<(&str, &str)> = pairs.collect::<Result<_, _>>()?;
        let path = Path::new(&self.world);
        if path.extension().is_some_and(|extension| extension == "toml") {
            return Ok(Recipe::read_with(path, &settings)?.along_real_paths(roots));
        }
        Ok(recipe_with(&self.world, &settings)?.along_real_paths(roots))
    }
}

fn main() -> ExitCode {
    cli::main(|| {
        let args = Args::parse();
        args.quiet.heed();
        let roots = DataRoots::new([args.data]);
        match args.command {
            Command::List => {
                for name in names() {
                    let recipe = recipe_with(name, &[])?;
                    let line = format!("world/{name}\t{}\t{}\n", recipe.places, recipe.counterpart);
                    cli::print(&line)?;
                }
            }
            Command::Render { which, cache } => {
                let recipe = which.recipe(&roots)?;
                let bar = cli::progress(&recipe.name, World::count(&recipe)?);
                let world = World::open(&recipe, &cache, &|| bar.inc(1))?;
                bar.finish_and_clear();
                cli::print(&format!("{}\n", world.folder.display()))?;
            }
            Command::Preview { which, output, queries } => {
                let sheet = preview(&which.recipe(&roots)?, queries, 3)?;
                let mut bytes = Cursor::new(Vec::new());
                ImageFormat::from_path(&output)
                    .and_then(|format| sheet.write_to(&mut bytes, format))
                    .with_context(|| output.display().to_string())?;
                replace(&output, bytes.get_ref())?;
                cli::note(&format!("generated: {}", output.display()));
            }
            Command::Shell(shell) => return shell.run::<Args>(),
        }
        Ok(Outcome::Success)
    })
}
