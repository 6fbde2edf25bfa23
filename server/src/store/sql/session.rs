//! A session of PostgreSQL with the statements that it has prepared.

use super::placeholders::Translated;
use super::rows::{Ahead, Question, Rows};
use super::value::{Kind, Owned, Value};
use super::{Error, Result};
use crate::store::error::StoreError;
use futures_util::future::{MaybeDone, maybe_done, try_join_all};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt;
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;
use tokio::runtime::Runtime;
use tokio::task::JoinHandle;
use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Client, Config, Row, Statement};
use tokio_postgres_rustls::MakeRustlsConnect;

/// Most statements that stay prepared; the store has fewer, but for lists that are filtered in many ways.
const MOST_PREPARED: usize = 256;

/// Most statements that are put off; then they are settled.
const MOST_LATER: usize = 256;

/// How long a session may take to say goodbye.
const GOODBYE: Duration = Duration::from_secs(1);

/// A statement that is put off, with its parameters.
type Later = Pin<Box<dyn Future<Output = Result<u64, tokio_postgres::Error>> + Send>>;

/// A session. Its thread drives the connection while it waits for an answer.
pub(in crate::store) struct Session {
    runtime: Runtime,
    /// None when it ends.
    client: Option<Arc<Client>>,
    /// Ends with the connection.
    connection: Option<JoinHandle<()>>,
    known: RefCell<HashMap<String, Known>>,
    later: RefCell<Vec<Later>>,
    /// What is to be put off as statements for many rows, and answers to questions that were asked ahead.
    ahead: RefCell<Ahead>,
}

/// A statement, prepared for each combination of types that it was used with.
struct Known {
    translated: Arc<Translated>,
    prepared: Vec<(Vec<Kind>, Statement)>,
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").finish_non_exhaustive()
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // The connection says goodbye when nobody has its client any more.
        self.forget_later();
        self.client = None;
        if let Some(connection) = self.connection.take() {
            let goodbye = async { tokio::time::timeout(GOODBYE, connection).await };
            // Nothing is lost if the server does not hear it.
            let _ = self.runtime.block_on(goodbye);
        }
    }
}

impl Session {
    pub(super) fn begin(config: &Config, tls: MakeRustlsConnect) -> Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| StoreError::Unavailable(error.to_string()))?;
        let (client, connection) = runtime.block_on(config.connect(tls))?;
        // Whoever waits for an answer hears that the connection is lost.
        let connection = runtime.spawn(async move { drop(connection.await) });
        Ok(Self {
            runtime,
            client: Some(Arc::new(client)),
            connection: Some(connection),
            known: RefCell::default(),
            later: RefCell::default(),
            ahead: RefCell::default(),
        })
    }

    /// Whether it can be used no more.
    pub(super) fn is_closed(&self) -> bool {
        self.client.as_ref().is_none_or(|client| client.is_closed())
    }

    fn client(&self) -> Result<&Arc<Client>> {
        let ended = || Error::Store(StoreError::Unavailable("the session has ended".to_owned()));
        self.client.as_ref().ok_or_else(ended)
    }

    /// Statements without parameters and rows, in one message.
    pub(super) fn batch(&self, sql: &str) -> Result<()> {
        self.put_off_rows()?;
        // It may end the transaction in which questions were answered.
        self.ahead.borrow_mut().forget();
        self.answer(self.client()?.batch_execute(sql))
    }

    /// Waits for what was put off; the first error of it.
    pub(super) fn settle(&self) -> Result<()> {
        self.put_off_rows()?;
        let is_settled = self.later.borrow().is_empty();
        if is_settled { Ok(()) } else { self.answer(std::future::ready(Ok(()))) }
    }

    /// Forgets what was put off; the transaction is undone.
    pub(super) fn forget_later(&self) {
        self.ahead.borrow_mut().forget();
        self.later.borrow_mut().clear();
    }

    /// The answer to a statement, which goes out behind those that were put off. If one of these fails, so does
    /// every later statement of the transaction; its own error says why.
    fn answer<T>(
        &self,
        asked: impl Future<Output = Result<T, tokio_postgres::Error>>,
    ) -> Result<T> {
        let later = self.later.take();
        self.runtime.block_on(async {
            let mut later: Vec<MaybeDone<Later>> = later.into_iter().map(maybe_done).collect();
            // Each goes out when it is first polled: in their order, and before `asked`.
            for statement in &mut later {
                poll_fn(|context| {
                    let _ = Pin::new(&mut *statement).poll(context);
                    Poll::Ready(())
                })
                .await;
            }
            let answer = asked.await;
            for mut statement in later {
                Pin::new(&mut statement).await;
                Pin::new(&mut statement).take_output().transpose()?;
            }
            Ok(answer?)
        })
    }

    /// The statement as PostgreSQL writes it.
    pub(super) fn translated(&self, sql: &str) -> Arc<Translated> {
        let mut known = self.known.borrow_mut();
        if let Some(known) = known.get(sql) {
            return Arc::clone(&known.translated);
        }
        if known.len() >= MOST_PREPARED {
            known.clear();
        }
        let translated = Arc::new(Translated::of(sql));
        let new = Known { translated: Arc::clone(&translated), prepared: Vec::new() };
        known.insert(sql.to_owned(), new);
        translated
    }

    /// The number of rows that a statement changes.
    pub(super) fn execute(
        &self,
        text: &Translated,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<usize> {
        self.put_off_rows()?;
        let values = in_order(text, values)?;
        let statement = self.prepared(text, &values)?;
        let changed = self.answer(self.client()?.execute(&statement, &references(&values)))?;
        Ok(usize::try_from(changed).unwrap_or(usize::MAX))
    }

    /// Puts a statement off.
    fn put_off(&self, text: &Translated, values: Vec<Owned>) -> Result<()> {
        let statement =
            self.prepared(text, &values.iter().map(Owned::value).collect::<Vec<_>>())?;
        let client = Arc::clone(self.client()?);
        let count = {
            let mut later = self.later.borrow_mut();
            later.push(Box::pin(async move {
                let values: Vec<Value<'_>> = values.iter().map(Owned::value).collect();
                client.execute(&statement, &references(&values)).await
            }));
            later.len()
        };
        if count >= MOST_LATER { self.answer(std::future::ready(Ok(()))) } else { Ok(()) }
    }

    /// The rows that a statement finds.
    pub(super) fn query(
        &self,
        text: &Translated,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<Vec<Row>> {
        let values = in_order(text, values)?;
        if let Some(answer) = self.ahead.borrow_mut().answer(&text.source, &values) {
            return Ok(answer);
        }
        self.put_off_rows()?;
        let statement = self.prepared(text, &values)?;
        self.answer(self.client()?.query(&statement, &references(&values)))
    }

    /// Adds a row to those of its statement.
    pub(super) fn execute_row_later(
        &self,
        rows: &'static Rows,
        target: &str,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<()> {
        let values: Vec<Value<'_>> = values.iter().map(|(_, value)| *value).collect();
        if self.ahead.borrow_mut().add(rows, target, &values) {
            return Ok(());
        }
        self.put_off_rows()?;
        self.ahead.borrow_mut().add(rows, target, &values);
        Ok(())
    }

    /// Puts off the statements of all rows.
    fn put_off_rows(&self) -> Result<()> {
        let statements = self.ahead.borrow_mut().take_rows();
        statements.into_iter().try_for_each(|(text, values)| {
            let text = self.translated(&text);
            self.put_off(&text, values)
        })
    }

    /// Asks questions, all at once.
    pub(super) fn ask_ahead(&self, questions: &[&Question]) -> Result<()> {
        let asked: Vec<_> = questions
            .iter()
            .map(|question| {
                let (text, values) = (self.translated(&question.sql), question.values());
                Ok((self.prepared(&text, &values)?, values))
            })
            .collect::<Result<_>>()?;
        let answers =
            self.query_all(asked.iter().map(|(statement, values)| (statement, values)))?;
        self.ahead.borrow_mut().remember(questions, answers);
        Ok(())
    }

    /// The rows that each of many statements finds, asked for all at once.
    fn query_all<'q, 'v: 'q>(
        &self,
        asked: impl Iterator<Item = (&'q Statement, &'q Vec<Value<'v>>)>,
    ) -> Result<Vec<Vec<Row>>> {
        let client = self.client()?;
        let one = |(statement, values): (&'q Statement, &'q Vec<Value<'v>>)| async move {
            client.query(statement, &references(values)).await
        };
        self.answer(try_join_all(asked.map(one)))
    }

    fn prepared(&self, text: &Translated, values: &[Value<'_>]) -> Result<Statement> {
        let kinds: Vec<Kind> = values.iter().map(Value::kind).collect();
        if let Some(known) = self.known.borrow().get(&text.source)
            && let Some((_, statement)) = known.prepared.iter().find(|(known, _)| *known == kinds)
        {
            return Ok(statement.clone());
        }
        let types: Vec<Type> = kinds.iter().map(|kind| kind.postgres()).collect();
        let statement = self.answer(self.client()?.prepare_typed(&text.text, &types))?;
        if let Some(known) = self.known.borrow_mut().get_mut(&text.source) {
            known.prepared.push((kinds, statement.clone()));
        }
        Ok(statement)
    }
}

/// The values by their numbers.
fn in_order<'a>(text: &Translated, values: &[(Option<&str>, Value<'a>)]) -> Result<Vec<Value<'a>>> {
    if text.names.is_empty() {
        return Ok(values.iter().map(|(_, value)| *value).collect());
    }
    let find = |name: &String| {
        let found = values.iter().find(|(known, _)| *known == Some(name.as_str()));
        let missing = || StoreError::Defect(format!("the parameter {name} has no value"));
        found.map(|(_, value)| *value).ok_or_else(|| Error::Store(missing()))
    };
    text.names.iter().map(find).collect()
}

fn references<'a>(values: &'a [Value<'_>]) -> Vec<&'a (dyn ToSql + Sync)> {
    values.iter().map(|value| value as &(dyn ToSql + Sync)).collect()
}
