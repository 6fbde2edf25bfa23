//! The files of an analysis: tables, report, figures, LaTeX and models. They contain the results of
//! [`sidestep::comparison`]. No number is computed here.

mod text;
mod charts;
mod page;
mod tables_csv;

use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Cell;
use sidestep::predict::PredictorFile;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A function that writes the content of a file.
pub type Content<'a> = &'a dyn Fn(&mut dyn Write) -> io::Result<()>;

/// Passes every file of an analysis to `put`, with its name and its writer. The parts of a name are
/// joined by `/`.
///
/// # Errors
/// The error of `put`, or of a template that uses an undefined value.
pub fn each_file(
    analysis: &Analysis,
    put: &mut dyn FnMut(&str, Content<'_>) -> io::Result<()>,
) -> io::Result<()> {
    for (name, table) in tables_csv::tables(analysis) {
        put(name, &|out| table(analysis, out))?;
    }
    let figures = charts::all(analysis);
    for figure in &figures {
        let svg = figure.svg();
        put(&format!("figures/{}.svg", figure.name), &|out| out.write_all(svg.as_bytes()))?;
    }
    for (name, text) in
        [("report.html", page::html(analysis, &figures)), ("tables.tex", page::latex(analysis))]
    {
        let text = text.map_err(io::Error::other)?;
        put(name, &|out| out.write_all(text.as_bytes()))?;
    }
    let numbers = page::numbers_json(analysis)?;
    put("numbers.json", &|out| out.write_all(numbers.as_bytes()))?;
    for cell in &analysis.comparison.cells {
        let experiment = Some(cell.experiment.number());
        let predictor = PredictorFile { experiment, ..cell.predictor.clone() };
        put(&model_file(analysis, cell), &|out| Ok(serde_json::to_writer(out, &predictor)?))?;
    }
    Ok(())
}

/// The name of the file with the model of a cell.
#[must_use]
pub fn model_file(analysis: &Analysis, cell: &Cell) -> String {
    let participant = &analysis.comparison.participants[cell.participant].name;
    let participant = tables_csv::file_name(participant);
    let (model, experiment) = (cell.model.word(), cell.experiment.number());
    format!("models/{model}-{experiment}-{}-{participant}.json", cell.features)
}

/// Writes every file of an analysis into an empty `folder`.
///
/// # Errors
/// The error of the disk or of a template.
pub fn write(analysis: &Analysis, folder: &Path) -> io::Result<()> {
    for part in ["figures", "models"] {
        std::fs::create_dir(folder.join(part))?;
    }
    each_file(analysis, &mut |name, write| {
        let mut out = BufWriter::new(File::create(folder.join(name))?);
        write(&mut out)?;
        out.flush()
    })
}
