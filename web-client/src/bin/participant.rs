//! Entry of the participant's page.

/// A third of the default allocator's size, and as fast for the work of this page.
#[global_allocator]
static ALLOCATOR: rlsf::SmallGlobalTlsf = rlsf::SmallGlobalTlsf::new();

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open);
}
