//! Entry point of the laboratory's page for value functions.

use sidestep_web::pages::lab::{Inspector, Lab};

fn main() {
    sidestep_web::browser::run(Lab::<Inspector>::open);
}
