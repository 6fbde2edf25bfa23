//! Entry of the participant's page.

/// A third of the size of the usual one, and as fast at what this page does.
#[global_allocator]
static ALLOCATOR: rlsf::SmallGlobalTlsf = rlsf::SmallGlobalTlsf::new();

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open);
}
