//! Entry of the participant's page.

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open);
}
