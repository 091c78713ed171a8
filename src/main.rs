use signorini::*;
fn main(){
  let a: Vec<String>=std::env::args().collect();
  let ks: Vec<usize>=a[1].split(',').map(|s|s.parse().unwrap()).collect();
  let verbose=a.get(2).is_some();
  for &k in &ks { 
  for (name,geo,loads) in [("A",reference::Geometry::OneBody,reference::CASE_A),("B",reference::Geometry::OneBody,reference::CASE_B),("T1",reference::Geometry::OneBody,reference::TABLE1),("T2",reference::Geometry::TwoBodies,reference::TABLE1),("T2g",reference::Geometry::TwoBodies,reference::Loads{tresca:4e7,..reference::TABLE1})] {
  let mesh=reference::mesh(geo,k);
  let p=reference::problem(geo,&mesh,&loads).unwrap();
  let mut d=stiffness::cholesky::CholeskyDual::new(&p).unwrap();
  print!("k={k} {name}");
  for eps in [1e-4,1e-6] { for beta in [0.01,0.05,1.0,1.9,20.0,100.0,1000.0] { if verbose {println!("eps {eps} beta {beta}");}
    let s=ssnm::solve(&p,&mut d,&ssnm::Settings{tolerance:eps,beta,..Default::default()},|s| {if verbose {println!("{s:?}");} std::ops::ControlFlow::Continue(())});
    print!(" {:2}/{:3}{}",s.info.first_met.unwrap_or((0,0)).0,s.info.first_met.unwrap_or((0,0)).1,if s.status==ssnm::Status::Converged {"".into()} else {format!("{:?}{:.0e}",s.status,s.info.kkt.max())}); } print!("  |");}
  println!();
  }}
}
