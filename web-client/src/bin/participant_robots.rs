//! Entry point of the participant's page of a study whose robots follow rules. The code of the rules
//! is a quarter of this program, so the page of other studies does without it.

/// The same allocator as that of the participant's page.
#[global_allocator]
static ALLOCATOR: rlsf::SmallGlobalTlsf = rlsf::SmallGlobalTlsf::new();

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open_with_robots);
}
