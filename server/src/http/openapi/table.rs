//! A table of routes. The same entry serves and documents a route, so no route lacks documentation.

use super::document::{Document, Entry};
use super::handler::Documented;
use super::operation::Operation;
use super::problems::meaning;
use super::schemas::Schemas;
use crate::http::app::App;
use axum::Router;
use axum::handler::Handler;
use axum::http::Method;
use axum::routing::{MethodFilter, MethodRouter, on};
use serde_json::{Value, json};
use std::sync::Arc;
use tower_http::compression::CompressionLayer;

type Describe = Box<dyn FnOnce(&mut Operation, &mut Schemas)>;

/// A method of a route.
pub struct Endpoint {
    method: Method,
    served: MethodRouter<Arc<App>>,
    summary: &'static str,
    detail: &'static str,
    describe: Describe,
}

macro_rules! endpoint {
    ($name:ident, $method:ident) => {
        #[doc = concat!("A `", stringify!($method), "`, with what it does in a line.")]
        pub fn $name<H, M, I, O>(summary: &'static str, handler: H) -> Endpoint
        where
            H: Handler<M, Arc<App>> + Documented<I, O>,
            M: 'static,
            I: 'static,
            O: 'static,
        {
            Endpoint {
                method: Method::$method,
                served: on(MethodFilter::$method, handler),
                summary,
                detail: "",
                describe: Box::new(H::describe),
            }
        }
    };
}

endpoint!(get, GET);
endpoint!(put, PUT);
endpoint!(post, POST);
endpoint!(delete, DELETE);

impl Endpoint {
    /// Adds further details.
    #[must_use]
    pub fn detail(mut self, text: &'static str) -> Self {
        self.detail = text;
        self
    }

    /// Adds codes of problems that this handler reports.
    #[must_use]
    pub fn problems<const N: usize>(self, codes: [&'static str; N]) -> Self {
        self.and(move |operation| operation.problems(&codes))
    }

    /// Adds a problem with this status. Its code is also used with another status.
    #[must_use]
    pub fn problem_with(self, status: u16, code: &'static str) -> Self {
        self.and(move |operation| operation.problem(meaning(code, Some(status))))
    }

    /// Sets the description of a successful response.
    #[must_use]
    pub fn says(self, status: u16, text: &'static str) -> Self {
        self.and(move |operation| {
            operation.answers.entry(status).or_default().0 = text.to_owned();
        })
    }

    /// Adds a 200 response for content that already exists, with the same body as the 201 response.
    #[must_use]
    pub fn or_200(self, text: &'static str) -> Self {
        self.and(move |operation| {
            let content = operation.answers.get(&201).map(|(_, content)| content.clone());
            operation.answers.insert(200, (text.to_owned(), content.unwrap_or_default()));
        })
    }

    /// Adds a 200 response with text of this media type.
    #[must_use]
    pub fn sends(self, media_type: &'static str) -> Self {
        self.sends_as(media_type, json!({ "type": "string" }))
    }

    /// Adds a 200 response with bytes of this media type.
    #[must_use]
    pub fn sends_bytes(self, media_type: &'static str) -> Self {
        self.sends_as(media_type, json!({ "type": "string", "contentMediaType": media_type }))
    }

    /// Adds a 200 response with JSON of any shape.
    #[must_use]
    pub fn sends_any_json(self) -> Self {
        self.sends_as("application/json", json!({}))
    }

    fn sends_as(self, media_type: &'static str, schema: Value) -> Self {
        self.and(move |operation| operation.answer(200, media_type, schema))
    }

    /// Adds a 200 response with JSON of this type, for a handler whose result type does not describe
    /// its body.
    #[must_use]
    pub fn sends_json<T: schemars::JsonSchema>(mut self) -> Self {
        let describe = self.describe;
        self.describe = Box::new(|operation, schemas| {
            describe(operation, schemas);
            let schema = schemas.of_answer::<T>();
            operation.answer(200, "application/json", schema);
        });
        self
    }

    /// Marks the route as open to anyone. A participant's token changes the response.
    #[must_use]
    pub fn for_participants_too(self) -> Self {
        self.and(|operation| operation.who = super::operation::Who::MaybeParticipant)
    }

    /// Compresses the responses.
    #[must_use]
    pub fn compressed(mut self) -> Self {
        self.served = self.served.layer(CompressionLayer::new());
        self
    }

    fn and(mut self, change: impl FnOnce(&mut Operation) + 'static) -> Self {
        let describe = self.describe;
        self.describe = Box::new(|operation, schemas| {
            describe(operation, schemas);
            change(operation);
        });
        self
    }
}

/// The table of routes, in groups.
#[derive(Default)]
pub struct Table {
    router: Router<Arc<App>>,
    document: Document,
    group: &'static str,
}

impl Table {
    /// Begins a group of routes.
    #[must_use]
    pub fn group(mut self, name: &'static str, text: &'static str) -> Self {
        self.document.group(name, text);
        self.group = name;
        self
    }

    /// Adds a route and its methods. Parameters in the path are in braces.
    #[must_use]
    pub fn route<const N: usize>(mut self, path: &str, endpoints: [Endpoint; N]) -> Self {
        let mut served = MethodRouter::new();
        for endpoint in endpoints {
            let Endpoint { method, served: one, summary, detail, describe } = endpoint;
            let group = self.group;
            self.document.add(Entry { group, method: &method, path, summary, detail }, describe);
            served = served.merge(one);
        }
        self.router = self.router.route(path, served);
        self
    }

    /// The router and its OpenAPI document.
    pub fn finished(self) -> (Router<Arc<App>>, Value) {
        (self.router, self.document.finished())
    }
}
