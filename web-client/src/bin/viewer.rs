//! Entry point of the laboratory's pages that draw scenes and predicted sets.

use sidestep_web::pages::lab::{Lab, Viewer};

fn main() {
    sidestep_web::browser::run(Lab::<Viewer>::open);
}
