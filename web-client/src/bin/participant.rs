//! Entry point of the participant's page.

/// This allocator is a third of the size of the default allocator, and equally fast for this page.
#[global_allocator]
static ALLOCATOR: rlsf::SmallGlobalTlsf = rlsf::SmallGlobalTlsf::new();

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open);
}
