# Loads an export of Sidestep and prints a small summary.
#
#     Rscript load_export.R FOLDER
#
# FOLDER is what `sidestep export --format csv`, `parquet` or `psych-ds` wrote, or an archive from the laboratory
# after it was unpacked. CSV needs no package; Parquet needs the package arrow.

arguments <- commandArgs(trailingOnly = TRUE)
if (length(arguments) != 1) stop("expected the folder of an export")
folder <- arguments[1]
if (!file.exists(file.path(folder, "manifest.json"))) {
  stop(folder, " has no manifest.json: the export is not complete, export again")
}

# The file of a table, whatever the format: steps.csv, steps.parquet or ..._description-steps_data.csv.
read_table <- function(name) {
  keyword <- paste0("_description-", gsub("_", "", name), "_data[.]csv$")
  files <- list.files(folder, recursive = TRUE)
  found <- files[files %in% paste0(name, c(".csv", ".parquet")) | grepl(keyword, files)]
  if (length(found) != 1) stop("expected one table ", name, " as CSV or Parquet, found ", length(found))
  path <- file.path(folder, found)
  if (grepl("[.]parquet$", path)) return(as.data.frame(arrow::read_parquet(path)))
  # An empty field has no value.
  read.csv(path, na.strings = "", numerals = "no.loss", check.names = FALSE)
}

trials <- read_table("trials")
steps <- read_table("steps")
tasks <- trials[trials$phase == "task", ]
omega <- as.numeric(steps$omega)
cat(sprintf("%d participants, %d tasks, %d steps\n",
            length(unique(trials$participant)), nrow(tasks), nrow(steps)))
cat(sprintf("mean closest distance in tasks: %.6f m; danger zone entered: %d\n",
            mean(as.numeric(tasks$closest_m)), sum(!is.na(tasks$first_step_in_danger))))
cat(sprintf("share of steps with a turn: %.6f\n", mean(omega != 0)))
