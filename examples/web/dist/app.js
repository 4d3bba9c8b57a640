import{$ as xt,B as X,C as f,D as ct,E as Ee,F as we,G as ut,H as ge,I as dt,J as pt,K as ve,L as ht,M as ft,N as mt,O as yt,P as qe,Q as be,R as P,S as Et,T as xe,U as wt,V as gt,W as vt,X as le,Y as Te,_ as bt,aa as Tt,ba as St,c as N,d as it,da as ce,ea as ue,f as se,fa as Rt,ga as Ht,h as ot,ha as Mt,i as O,ia as At,j as fe,ja as _t,k as u,l as st,m as Y,n as me,o as M,p as U,q as at,r as lt,t as ae,u as T,v as Ne,w as ye,x as W,y as V}from"./shared.js";var Se=class{texture;width;height;truth;shown;source;changed=new bt;constructor(e,t){[this.width,this.height]=[e,t],this.truth=new Uint8Array(4*e*t).fill(255),this.shown=this.truth.slice();let n=()=>new ct(this.shown,e,t);[this.texture,this.source]=[n(),n()],this.texture.magFilter=this.texture.minFilter=it,this.texture.needsUpdate=!0}write(e){for(let t=0;t<e.height;t++){let n=4*((e.top+t)*this.width+e.left),i=3*t*e.width;for(let o=0;o<e.width;o++,n+=4,i+=3)this.truth[n]=e.rgb[i]??0,this.truth[n+1]=e.rgb[i+1]??0,this.truth[n+2]=e.rgb[i+2]??0}this.restore(e)}restore({left:e,top:t,width:n,height:i}){for(let o=t;o<t+i;o++){let s=4*(o*this.width+e);this.shown.set(this.truth.subarray(s,s+4*n),s)}this.touch({left:e,top:t,width:n,height:i})}stain(e,t,n){let{left:i,top:o,width:s,height:a}=e;for(let l=o;l<o+a;l++)for(let c=i;c<i+s;c++){let d=4*(l*this.width+c),p=n(c,l);for(let m=0;m<3;m++)this.shown[d+m]=(1-p)*(this.shown[d+m]??0)+p*(t[m]??0)}this.touch(e)}upload(e){this.changed.isEmpty()||(e.copyTextureToTexture(this.source,this.texture,this.changed,this.changed.min),this.changed.makeEmpty())}touch({left:e,top:t,width:n,height:i}){this.changed.expandByPoint(new O(e,t)).expandByPoint(new O(e+n,t+i))}},Re=class{pictures;constructor(e,t){this.pictures=[new Se(e,t),new Se(e,t)]}update(e){this.pictures[e.picture===0?0:1].write(e)}upload(e){for(let t of this.pictures)t.upload(e)}};var ln=3500,He=class{sign;line;canvas=document.createElement("canvas");texture;timer=0;last=!1;constructor(e){this.line=e,this.canvas.width=1024,this.canvas.height=128,this.texture=new ut(this.canvas),this.texture.colorSpace=se;let t=new X({map:this.texture,transparent:!0,depthTest:!1});this.sign=new f(new ve(.8,.1),t),this.sign.position.set(0,.22,-1.2),this.sign.renderOrder=10,this.sign.visible=!1}say(e,t){this.show(e,t,!1)}stay(e,t){this.show(e,t,!0),this.last=!0}show(e,t,n){if(this.last)return;this.line.textContent=e,this.line.classList.add("on");let i=this.canvas.getContext("2d");i&&(i.clearRect(0,0,1024,128),i.fillStyle="rgba(38, 49, 58, 0.88)",i.fillRect(0,0,1024,128),i.fillStyle="#fff",i.font="46px system-ui, sans-serif",i.textAlign="center",i.textBaseline="middle",i.fillText(e,512,66,990),this.texture.needsUpdate=!0),this.sign.visible=t,clearTimeout(this.timer),this.timer=n?0:window.setTimeout(()=>{this.line.classList.remove("on"),this.sign.visible=!1},ln)}};var Me=class{socket=null;key="";next=0;unsent=[];sent=0;answers=0;left=[];latest=0;due=!1;roundTrips=[];stalled=!1;welcomed=!1;ended=!1;listener;constructor(e){this.listener=e,this.open(),setInterval(()=>this.flush(),8)}state(e){return this.key===""||this.ended?-1:(this.unsent.push({state:{...e,sequence:this.next}}),this.soon(),this.next++)}soon(){this.due||performance.now()-this.latest<8||(this.due=!0,queueMicrotask(()=>this.flush()))}command(e){this.key!==""&&!this.ended&&this.unsent.push({command:{sequence:this.next++,command:e}})}get waiting(){return this.unsent.length}drop(){this.socket?.close()}end(){this.ended=!0}open(){let e=new URLSearchParams(location.search);this.key!==""&&e.set("key",this.key);let t=location.protocol==="https:"?"wss":"ws",n=new WebSocket(`${t}://${location.host}/session?${e}`);n.binaryType="arraybuffer",this.socket=n,n.onmessage=i=>{i.data instanceof ArrayBuffer?this.listener.binary(i.data):this.take(JSON.parse(i.data))},n.onclose=i=>{if(this.welcomed=!1,this.ended)return;let o=i.code===4001;o?this.listener.occupied():this.listener.connected(!1),setTimeout(()=>this.open(),o?3e3:500)}}take(e){if(e.type==="welcome"||e.type==="watching")this.key===""?this.next=e.next_sequence:this.key!==e.key&&location.reload(),this.key=e.key,this.acknowledge(e.next_sequence),this.sent=0,this.left=[],this.welcomed=!0,this.listener.connected(!0);else if(e.type==="ack"){let t=this.left.shift();t!==void 0&&this.roundTrips.push(performance.now()-t)>2e3&&this.roundTrips.shift(),this.acknowledge(e.next_sequence)}this.listener.message(e)}acknowledge(e){let t=Math.max(0,Math.min(this.unsent.length,e-(this.next-this.unsent.length)));this.unsent.splice(0,t),this.sent=Math.max(0,this.sent-t),this.stalled||=t===0&&this.sent>0,--this.answers<=0&&(this.answers=0,this.sent=0,this.stalled=!1)}flush(){this.due=!1;let e=this.socket;if(!this.welcomed||!e||e.readyState!==WebSocket.OPEN){this.answers=0;return}if(this.stalled)return;let t=this.unsent.slice(this.sent,this.sent+500);t.length!==0&&(e.send(JSON.stringify({events:t})),this.sent+=t.length,this.answers++,this.latest=performance.now(),this.left.push(this.latest),this.listener.sent(this.next-this.unsent.length+this.sent))}};var je=1.1,cn=1,Ae=class{group=new M;heading=0;keys=new Set;wish=[0,0,0,0];constructor(){let e=new P({color:9083301,transparent:!0,opacity:.7}),t=(n,i,o,s)=>{let a=new f(new ge(n,i,o),e);a.position.set(...s),this.group.add(a)};t(1.1,.04,.9,[0,-1.62,0]);for(let n of[-.45,.45])t(1.1,.04,.04,[0,-.75,n]);for(let n of[-.55,.55]){t(.04,.04,.9,[n,-.75,0]);for(let i of[-.45,.45])t(.04,.87,.04,[n,-1.18,i])}}place(e,t){this.group.position.set(...e),this.heading=t,this.turn()}move(e){let t=(l,c)=>Number(this.keys.has(l))-Number(this.keys.has(c)),[n,i,o,s]=this.wish,a=[n+t("KeyW","KeyS"),i+t("KeyA","KeyD"),o+t("KeyE","KeyQ")];this.step(je*e*a[0],je*e*a[1],je*e*a[2]),this.heading+=cn*e*(s+t("ArrowLeft","ArrowRight")),this.turn()}step(e,t,n){let[i,o]=[Math.cos(this.heading),Math.sin(this.heading)],s=this.group.position;s.x+=e*i-t*o,s.y+=e*o+t*i,s.z=Math.max(.3,s.z+n)}turn(){let e=new fe().setFromAxisAngle(new u(1,0,0),Math.PI/2);this.group.quaternion.setFromAxisAngle(new u(0,0,1),this.heading-Math.PI/2).multiply(e)}};function Le(r){let e=r.fenceSync(r.SYNC_GPU_COMMANDS_COMPLETE,0);return r.flush(),new Promise(t=>{let n=()=>{if(e&&r.clientWaitSync(e,0,0)===r.TIMEOUT_EXPIRED)return void setTimeout(n,1);r.deleteSync(e),t(performance.now())};n()})}var _e=class{stages={};sequence=-1;times=[];guess=0;constructor(){this.clear()}clear(){this.stages={"hand to sent":[],"sent to answer":[],"answer to texels":[],"texels to picture":[],"hand to screen":[],"hand to guess":[]},[this.sequence,this.guess]=[-1,0]}hand(e,t){this.sequence>=0&&t-(this.times[0]??0)<2e3||([this.sequence,this.times]=[e,[t]])}guessed(e){this.guess===0&&(this.guess=e)}sent(e){this.pass(1,e)}answered(e){this.pass(2,e)}texels(){this.pass(3,1/0)}drawn(e){let t=this.guess,n=this.times.length===4&&this.sequence>=0?this.times:[];n.length===0&&t===0||(this.guess=0,n.length>0&&(this.sequence=-1),Le(e).then(i=>{t>0&&this.keep(5,i-t),n.length!==0&&([...n.slice(1),i].forEach((o,s)=>this.keep(s,o-(n[s]??0))),this.keep(4,i-(n[0]??0)))}))}pass(e,t){this.sequence>=0&&this.sequence<t&&this.times.length===e&&this.times.push(performance.now())}keep(e,t){let n=Object.values(this.stages)[e];n&&n.push(t)>2e3&&n.shift()}};var Ue=class{spots=[];answered=0;before=0;picture;constructor(e){this.picture=e}spray({sequence:e,time:t,uv:n,texel:i,distance:o,colour:s,flow:a}){let l=Math.min(.05,(t-this.before)/1e3);this.before=t;let c=.15*o,d=a*l/(2*Math.PI*c**2),[p,m]=[n.x*this.picture.width-.5,n.y*this.picture.height-.5],w=2.5*c/i,[K,ie]=[Math.max(0,Math.ceil(p-w)),Math.max(0,Math.ceil(m-w))],oe=Math.min(this.picture.width,Math.floor(p+w)+1)-K,he=Math.min(this.picture.height,Math.floor(m+w)+1)-ie;if(oe<=0||he<=0)return;let Fe=i**2/(2*c**2),D=(on,sn)=>{let an=(on-p)**2+(sn-m)**2;return 1-Math.exp(-d/2e-5*Math.exp(-Fe*an))},L={sequence:e,since:performance.now(),colour:s,share:D,left:K,top:ie,width:oe,height:he};this.spots.push(L),this.picture.stain(L,s,D)}answer(e){this.answered=e}texels(){this.settle(e=>e.sequence<this.answered)}tidy(){let e=performance.now()-300,t=this.spots.some(n=>n.since<e);return t&&this.settle(n=>n.since<e),t}settle(e){for(let t of this.spots)this.picture.restore(t);this.spots=this.spots.filter(t=>!e(t));for(let t of this.spots)this.picture.stain(t,t.colour,t.share)}};var un=3,dn=new u(1,0,0),Pe=class{group=new M;hit=null;position=new u;direction=new u(1,0,0);ray;spot;constructor(){let e=new W().setAttribute("position",new T(new Float32Array(6),3));this.ray=new we(e,new Ee({color:16777215,transparent:!0,opacity:.75})),this.ray.frustumCulled=!1,this.spot=new f(new ht(.8,1,40),new X({color:16777215,transparent:!0,opacity:.9,side:N,depthTest:!1})),this.group.add(this.ray,this.spot)}hold(e,t,n){this.position.copy(e),this.direction.copy(t),this.hit=n.hit(e,t),this.draw(e,.018)}point(e,t,n,i){this.hit=n.hit(e,t),this.hit&&this.hit.point.distanceTo(e)<=un?(this.position.copy(this.hit.point).addScaledVector(this.hit.normal,i),this.direction.copy(this.hit.normal).negate()):(this.position.copy(e),this.direction.copy(t)),this.draw(this.position,.15*i)}get distance(){return this.hit?this.position.distanceTo(this.hit.point):1/0}set visible(e){this.group.visible=e}get pose(){let e=new fe().setFromUnitVectors(dn,this.direction).normalize();return{translation:this.position.toArray(),rotation:[e.x,e.y,e.z,e.w]}}draw(e,t){let n=this.hit?.point??e.clone().addScaledVector(this.direction,2);this.ray.geometry.attributes.position.set([...e.toArray(),...n.toArray()]).needsUpdate=!0,this.spot.visible=this.hit!==null,this.hit&&(this.spot.position.copy(this.hit.point).addScaledVector(this.hit.normal,.003),this.spot.quaternion.setFromUnitVectors(new u(0,0,1),this.hit.normal),this.spot.scale.setScalar(Math.max(t,.008)))}};var Lt=0,pn=1,hn=2,fn=3,Ut="paintcopter.paint-button";function mn(){try{return localStorage.getItem(Ut)}catch{return null}}var Q=class{mode="idle";swapped=mn()==="trigger";origin=new u;direction=new u;renderer;cradle;hands;constructor(e,t){this.renderer=e,this.cradle=t,e.xr.enabled=!0,e.xr.setReferenceSpaceType("local");let n=new pt(.012,.02,.16).rotateX(-Math.PI/2).translate(0,0,.06),i=new P({color:4608862});this.hands=[0,1].map(o=>{let s=e.xr.getController(o);return s.add(new f(n,i)),t.group.add(s),s})}swap(){this.swapped=!this.swapped;try{localStorage.setItem(Ut,this.swapped?"trigger":"touchpad")}catch{}}get presenting(){return this.renderer.xr.isPresenting}static async available(){return await navigator.xr?.isSessionSupported("immersive-vr").catch(()=>!1)??!1}async enter(){let e=await navigator.xr?.requestSession("immersive-vr",{optionalFeatures:["local","local-floor"]});e&&await this.renderer.xr.setSession(e)}update(){this.mode="idle",this.cradle.wish=[0,0,0,0];let e=!1;return[...this.renderer.xr.getSession()?.inputSources??[]].forEach((n,i)=>{let o=this.hands[i];if(!n.gamepad||!o)return;let s=w=>n.gamepad?.buttons[w]?.pressed??!1,a=n.gamepad.axes,[l,c]=a.length>=4?[a[2],a[3]]:[a[0]??0,a[1]??0];if(n.handedness==="left"){let w=K=>Math.abs(K)<.15?0:K;s(pn)?this.cradle.wish=[0,-w(l),-w(c),0]:this.cradle.wish=[-w(c),0,0,-w(l)];return}e=!0,o.getWorldPosition(this.origin),this.direction.set(0,0,-1).transformDirection(o.matrixWorld);let d=s(hn)||s(fn),[p,m]=this.swapped?[s(Lt),d]:[d,s(Lt)];this.mode=p?"painting":m?"viewing":"idle"}),e}};var J={colour:new U(16054527),ground:new U(9273200),strength:1.9},Be={colour:new U(16773597),strength:1.7},yn=2.2,$e=1.25,Ke=new Et(J.colour,J.ground,J.strength);Ke.position.set(0,0,1);var de=new wt(Be.colour,Be.strength);function Pt(r){let e=de.position.clone().normalize(),t=new Uint8Array(4*r.count),n=new u,i=new U,o=new U;for(let s=0;s<r.count;s++){n.fromBufferAttribute(r,s),i.copy(J.ground).lerp(J.colour,.5+.5*n.z).multiplyScalar(J.strength),i.add(o.copy(Be.colour).multiplyScalar(Be.strength*Math.max(0,n.dot(e))));for(let[a,l]of i.toArray().entries())t[4*s+a]=Math.min(255,Math.round(255/$e*(l/Math.PI)**(1/yn)))}return new T(t,4,!0)}var Ce=class{at={x:0,y:0};painting=!1;viewing=!1;pitch=0;fingers=new Map;constructor(e,t,n){e.addEventListener("contextmenu",o=>o.preventDefault()),e.addEventListener("pointerdown",o=>{e.setPointerCapture(o.pointerId),this.fingers.set(o.pointerId,{x:o.clientX,y:o.clientY}),this.aim(e,o),n(o.timeStamp),this.painting=o.button===0&&this.fingers.size===1,this.viewing=o.button===1}),e.addEventListener("pointermove",o=>{let s=this.fingers.get(o.pointerId);if(s){let[a,l]=[o.clientX-s.x,o.clientY-s.y];this.fingers.size===2?t.step(this.pinch(o),.004*a,.004*l):o.buttons&2&&(t.heading+=.004*a,this.pitch=Math.max(-1.4,Math.min(1.4,this.pitch+.004*l))),this.fingers.set(o.pointerId,{x:o.clientX,y:o.clientY})}for(let a of this.painting?o.getCoalescedEvents():[])this.aim(e,a),n(a.timeStamp);this.aim(e,o)});let i=o=>{this.aim(e,o),n(o.timeStamp),this.fingers.delete(o.pointerId),this.painting=!1,this.viewing=!1};e.addEventListener("pointerup",i),e.addEventListener("pointercancel",i),e.addEventListener("wheel",o=>{o.preventDefault(),t.step(-.0015*o.deltaY,0,0)},{passive:!1})}aim(e,t){let n=e.getBoundingClientRect();this.at.x=2*(t.clientX-n.left)/n.width-1,this.at.y=1-2*(t.clientY-n.top)/n.height}pinch(e){let t=[...this.fingers].find(([o])=>o!==e.pointerId)?.[1],n=this.fingers.get(e.pointerId);if(!t||!n)return 0;let i=(o,s)=>Math.hypot(o-t.x,s-t.y);return .006*(i(e.clientX,e.clientY)-i(n.x,n.y))}};function Bt(r){let e=new DataView(r),t=n=>e.getUint16(4+2*n,!0);return{picture:e.getUint8(1),left:t(0),top:t(1),width:t(2),height:t(3),rgb:new Uint8Array(r,12)}}function Ct(r){let e=new DataView(r),t=e.getUint32(4,!0),n=e.getUint32(8,!0),i=12+12*t;return{positions:new Float32Array(r,12,3*t),uv:new Float32Array(r,i,2*t),faces:new Uint32Array(r,i+8*t,3*n)}}function zt(r){let e=8+new DataView(r).getUint32(4,!0);return[JSON.parse(new TextDecoder().decode(new Uint8Array(r,8,e-8))),e]}function kt(r){let[e,t]=zt(r),n=t;for(let i of e.parts)i.positions=new Float32Array(r,n,3*i.vertices),i.colours=new Uint8Array(r,n+12*i.vertices,4*i.vertices),i.indices=new Uint32Array(r,n+16*i.vertices,i.corners),n+=16*i.vertices+4*i.corners;return e}function Dt(r){let[e,t]=zt(r);return{...e,data:new Uint8Array(r,t)}}var En=14247467,ze=class{group=new M;camera=new xe(50,4/3,.05,20);latest="";body=new M;arm;spray;joint;skin=new P({color:En,transparent:!0,opacity:.35});constructor(){let e=new f(new ge(.26,.26,.09),this.skin);this.body.add(e);let t=new mt(.12,.006,6,28);for(let i=0;i<6;i++){let o=new f(t,this.skin),s=Math.PI/3*(i+.5);o.position.set(.27*Math.cos(s),.27*Math.sin(s),.05),this.body.add(o)}let n=i=>new we(new W().setAttribute("position",new T(new Float32Array(6),3)),new Ee({color:i,transparent:!0,opacity:.9}));this.arm=n(3819088),this.spray=n(3112417),this.joint=new f(new ft(.022),this.skin);for(let i of[this.arm,this.spray])i.frustumCulled=!1;this.group.add(this.body,this.arm,this.spray,this.joint),this.camera.up.set(0,0,1)}update(e){let{position:t,rotation:n,nozzle:i,aim:o,spraying:s}=e,a=this.latest;if(this.latest=JSON.stringify([t,n,i,o,s]),this.latest===a)return!1;this.body.position.set(...e.position),this.body.quaternion.set(...e.rotation),this.joint.position.set(...e.nozzle);let l=(c,d,p)=>{c.geometry.attributes.position.set([...d,...p]).needsUpdate=!0};return l(this.arm,e.position,e.nozzle),l(this.spray,e.nozzle,e.aim),this.spray.visible=e.spraying,this.camera.position.set(...e.nozzle),this.camera.lookAt(...e.aim),this.camera.updateMatrixWorld(),!0}set shown(e){this.skin.opacity=e?.9:.35}};var E=r=>document.getElementById(r),ke=class{colour=0;erasing=!1;paints=[];standOff=[.06,.14];far=0;waiting=!1;constructor(e){for(let t of["record","pause","live","fly","undo","erase","flown","hands","save","end","enter"]){let n=E(t);n.addEventListener("click",()=>{let i=n.hasAttribute("aria-pressed"),o=i&&n.getAttribute("aria-pressed")!=="true";i&&n.setAttribute("aria-pressed",String(o)),t==="erase"&&(this.erasing=o),n.blur(),e(t,o)})}}welcome(e){this.standOff=e.stand_off,this.far=e.far,this.paints=e.palette.map(n=>n.srgb),E("live").setAttribute("aria-pressed",String(e.live)),this.paused(e.paused);let t=E("palette");t.replaceChildren(...e.palette.map((n,i)=>{let o=document.createElement("button");return o.style.background=`rgb(${n.srgb.join(",")})`,o.title=n.name,o.setAttribute("role","radio"),o.setAttribute("aria-label",n.name),o.setAttribute("aria-checked",String(i===this.colour)),o.addEventListener("click",()=>{this.colour=i;for(let[s,a]of[...t.children].entries())a.setAttribute("aria-checked",String(s===i))}),o}))}get paint(){return this.paints[this.colour]??[0,0,0]}get flow(){return 5e-7*E("flow").valueAsNumber}get distance(){let[e,t]=this.standOff;return e+(t-e)*E("brush").valueAsNumber}paintsFrom(e){return this.isPaused||this.waiting||e>=this.far?null:Math.min(this.standOff[1],Math.max(this.standOff[0],e))}watching(e){document.body.classList.toggle("watching",e),E("pause").title=e?"Hold the picture; a recording stops (P)":"Leave out what your hand does (P)"}get isPaused(){return E("pause").getAttribute("aria-pressed")==="true"}paused(e){E("pause").setAttribute("aria-pressed",String(e)),E("record").setAttribute("aria-pressed",String(!e))}playback(e){E("played").textContent=e===null?"live":`${e.toFixed(1)} s`}connected(e,t){E("dot").classList.toggle("on",e),E("connection").textContent=e?"connected":`connection lost, ${t} states kept`}status(e){E("dot").classList.remove("on"),E("connection").textContent=e}robot(e){this.paused(e.paused),this.waiting=e.waiting,E("lag").textContent=`${e.lag.toFixed(2)} m`,E("latency").textContent=e.latency>0?`${e.latency.toFixed(1)} s`:"\u2013"}hands(e){E("hands").textContent=e?"paint: trigger":"paint: touchpad"}headset(e){E("enter").hidden=!e,E("hands").hidden=!e}};var wn=`
  attribute vec3 light;
  varying vec2 vUv;
  varying vec3 vLight;
  varying vec3 vWorld;
  void main() {
    vUv = uv;
    vLight = ${$e} * light;
    vWorld = position;
    gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
  }`,gn=`
  uniform sampler2D map;
  uniform sampler2D flownMap;
  uniform float flownShare;
  uniform float robotView;
  uniform mat4 viewFromWorld;
  varying vec2 vUv;
  varying vec3 vLight;
  varying vec3 vWorld;
  void main() {
    vec3 colour = texture2D(map, vUv).rgb;
    if (flownShare + robotView > 0.0) {
      // What the robot's camera sees is thrown back onto the surface, with a frame about it.
      vec4 seenBy = viewFromWorld * vec4(vWorld, 1.0);
      vec2 inView = abs(seenBy.xy / seenBy.w);
      float inside = robotView * float(seenBy.w > 0.0 && max(inView.x, inView.y) < 1.0);
      colour = mix(colour, texture2D(flownMap, vUv).rgb, max(flownShare, inside));
      colour = mix(colour, vec3(0.35, 0.70, 0.95), inside * step(0.96, max(inView.x, inView.y)));
    }
    gl_FragColor = vec4(colour * vLight, 1.0);
  }`,De=class{mesh;texel;caster=new Te;uniforms;constructor(e,t){let n=new W;n.setAttribute("position",new T(e.positions,3)),n.setAttribute("uv",new T(e.uv,2)),n.setIndex(new T(e.faces.slice(),1)),n.computeVertexNormals(),n.boundsTree=new At(n,{indirect:!0}),n.setAttribute("light",Pt(n.attributes.normal)),n.deleteAttribute("normal"),this.uniforms={map:{value:t.pictures[0].texture},flownMap:{value:t.pictures[1].texture},flownShare:{value:0},robotView:{value:0},viewFromWorld:{value:new me}};let i=new be({uniforms:this.uniforms,vertexShader:wn,fragmentShader:gn,side:N});this.mesh=new f(n,i),this.mesh.raycast=_t,this.caster.firstHitOnly=!0;let{width:o,height:s}=t.pictures[0];this.texel=Math.sqrt(vn(e)/(o*s))}set flown(e){this.uniforms.flownShare.value=e?1:0}project(e){this.uniforms.robotView.value=e?1:0,e&&this.uniforms.viewFromWorld.value.multiplyMatrices(e.projectionMatrix,e.matrixWorldInverse)}hit(e,t){this.caster.set(e,t);let n=this.caster.intersectObject(this.mesh,!1)[0];if(!n?.face)return null;let i=n.normal??n.face.normal;return{point:n.point,normal:i.clone().normalize(),uv:n.uv??new O}}};function vn({positions:r,uv:e,faces:t}){let[n,i]=[new u,new u],[o,s]=[0,0],a=(l,c,d,p,m)=>l.set(...[0,1,2].map(w=>w<d?(c[d*m+w]??0)-(c[d*p+w]??0):0));for(let l=0;l<t.length;l+=3){let[c,d,p]=[t[l]??0,t[l+1]??0,t[l+2]??0];o+=a(n,r,3,c,d).cross(a(i,r,3,c,p)).length(),s+=a(n,e,2,c,d).cross(a(i,e,2,c,p)).length()}return o/s}ce.line={worldUnits:{value:1},linewidth:{value:1},resolution:{value:new O},dashOffset:{value:0},dashScale:{value:1},dashSize:{value:1},gapSize:{value:1}};ue.line={uniforms:qe.merge([ce.common,ce.fog,ce.line]),vertexShader:`
		#include <common>
		#include <color_pars_vertex>
		#include <fog_pars_vertex>
		#include <logdepthbuf_pars_vertex>
		#include <clipping_planes_pars_vertex>

		uniform float linewidth;
		uniform vec2 resolution;

		attribute vec3 instanceStart;
		attribute vec3 instanceEnd;

		attribute vec3 instanceColorStart;
		attribute vec3 instanceColorEnd;

		#ifdef WORLD_UNITS

			varying vec4 worldPos;
			varying vec3 worldStart;
			varying vec3 worldEnd;

			#ifdef USE_DASH

				varying vec2 vUv;

			#endif

		#else

			varying vec2 vUv;

		#endif

		#ifdef USE_DASH

			uniform float dashScale;
			attribute float instanceDistanceStart;
			attribute float instanceDistanceEnd;
			varying float vLineDistance;

		#endif

		float trimSegmentAlpha( const in vec4 start, const in vec4 end ) {

			// compute the interpolation factor needed to trim the segment so it terminates
			// between the camera plane and the near plane

			// conservative estimate of the near plane
			float a = projectionMatrix[ 2 ][ 2 ]; // 3nd entry in 3th column
			float b = projectionMatrix[ 3 ][ 2 ]; // 3nd entry in 4th column

			// we need different nearEstimate formula for reversed and default depth buffer
			// a is positive with a reversed depth buffer so it can be used for controlling the code flow
			float nearEstimate = ( a > 0.0 ) ? ( - b / ( a + 1.0 ) ) : ( - 0.5 * b / a );

			return ( nearEstimate - start.z ) / ( end.z - start.z );

		}

		void main() {

			#ifdef USE_COLOR

				vColor.xyz = ( position.y < 0.5 ) ? instanceColorStart : instanceColorEnd;

			#endif

			float aspect = resolution.x / resolution.y;

			// camera space
			vec4 start = modelViewMatrix * vec4( instanceStart, 1.0 );
			vec4 end = modelViewMatrix * vec4( instanceEnd, 1.0 );

			#ifdef USE_DASH

				float lineDistanceStart = dashScale * instanceDistanceStart;
				float lineDistanceEnd = dashScale * instanceDistanceEnd;

			#endif

			#ifdef WORLD_UNITS

				worldStart = start.xyz;
				worldEnd = end.xyz;

			#else

				vUv = uv;

			#endif

			// special case for perspective projection, and segments that terminate either in, or behind, the camera plane
			// clearly the gpu firmware has a way of addressing this issue when projecting into ndc space
			// but we need to perform ndc-space calculations in the shader, so we must address this issue directly
			// perhaps there is a more elegant solution -- WestLangley

			bool perspective = ( projectionMatrix[ 2 ][ 3 ] == - 1.0 ); // 4th entry in the 3rd column

			if ( perspective ) {

				if ( start.z < 0.0 && end.z >= 0.0 ) {

					float alpha = trimSegmentAlpha( start, end );
					end.xyz = mix( start.xyz, end.xyz, alpha );

					#ifdef USE_DASH

						lineDistanceEnd = mix( lineDistanceStart, lineDistanceEnd, alpha );

					#endif

				} else if ( end.z < 0.0 && start.z >= 0.0 ) {

					float alpha = trimSegmentAlpha( end, start );
					start.xyz = mix( end.xyz, start.xyz, alpha );

					#ifdef USE_DASH

						lineDistanceStart = mix( lineDistanceEnd, lineDistanceStart, alpha );

					#endif

				}

			}

			#ifdef USE_DASH

				vLineDistance = ( position.y < 0.5 ) ? lineDistanceStart : lineDistanceEnd;
				vUv = uv;

			#endif

			// clip space
			vec4 clipStart = projectionMatrix * start;
			vec4 clipEnd = projectionMatrix * end;

			// ndc space
			vec3 ndcStart = clipStart.xyz / clipStart.w;
			vec3 ndcEnd = clipEnd.xyz / clipEnd.w;

			// direction
			vec2 dir = ndcEnd.xy - ndcStart.xy;

			// account for clip-space aspect ratio
			dir.x *= aspect;
			dir = normalize( dir );

			#ifdef WORLD_UNITS

				vec3 worldDir = normalize( end.xyz - start.xyz );
				vec3 tmpFwd = perspective ? normalize( mix( start.xyz, end.xyz, 0.5 ) ) : vec3( 0.0, 0.0, - 1.0 );
				vec3 worldUp = normalize( cross( worldDir, tmpFwd ) );
				vec3 worldFwd = cross( worldDir, worldUp );
				worldPos = position.y < 0.5 ? start: end;

				// height offset
				float hw = linewidth * 0.5;
				worldPos.xyz += position.x < 0.0 ? hw * worldUp : - hw * worldUp;

				// don't extend the line if we're rendering dashes because we
				// won't be rendering the endcaps
				#ifndef USE_DASH

					// cap extension
					worldPos.xyz += position.y < 0.5 ? - hw * worldDir : hw * worldDir;

					// add width to the box
					worldPos.xyz += worldFwd * hw;

					// endcaps
					if ( position.y > 1.0 || position.y < 0.0 ) {

						worldPos.xyz -= worldFwd * 2.0 * hw;

					}

				#endif

				// project the worldpos
				vec4 clip = projectionMatrix * worldPos;

				// shift the depth of the projected points so the line
				// segments overlap neatly
				vec3 clipPose = ( position.y < 0.5 ) ? ndcStart : ndcEnd;

				// only shift the depth of vertices in front of the camera (#35137)
				if ( clip.w > 0.0 ) clip.z = clipPose.z * clip.w;

			#else

				vec2 offset = vec2( dir.y, - dir.x );
				// undo aspect ratio adjustment
				dir.x /= aspect;
				offset.x /= aspect;

				// sign flip
				if ( position.x < 0.0 ) offset *= - 1.0;

				// endcaps
				if ( position.y < 0.0 ) {

					offset += - dir;

				} else if ( position.y > 1.0 ) {

					offset += dir;

				}

				// adjust for linewidth
				offset *= linewidth;

				// adjust for clip-space to screen-space conversion // maybe resolution should be based on viewport ...
				offset /= resolution.y;

				// select end
				vec4 clip = ( position.y < 0.5 ) ? clipStart : clipEnd;

				// back to clip space
				offset *= clip.w;

				clip.xy += offset;

			#endif

			gl_Position = clip;

			vec4 mvPosition = ( position.y < 0.5 ) ? start : end; // this is an approximation

			#include <logdepthbuf_vertex>
			#include <clipping_planes_vertex>
			#include <fog_vertex>

		}
		`,fragmentShader:`
		uniform vec3 diffuse;
		uniform float opacity;
		uniform float linewidth;

		#ifdef USE_DASH

			uniform float dashOffset;
			uniform float dashSize;
			uniform float gapSize;

		#endif

		varying float vLineDistance;

		#ifdef WORLD_UNITS

			varying vec4 worldPos;
			varying vec3 worldStart;
			varying vec3 worldEnd;

			#ifdef USE_DASH

				varying vec2 vUv;

			#endif

		#else

			varying vec2 vUv;

		#endif

		#include <common>
		#include <color_pars_fragment>
		#include <fog_pars_fragment>
		#include <logdepthbuf_pars_fragment>
		#include <clipping_planes_pars_fragment>

		vec2 closestLineToLine(vec3 p1, vec3 p2, vec3 p3, vec3 p4) {

			float mua;
			float mub;

			vec3 p13 = p1 - p3;
			vec3 p43 = p4 - p3;

			vec3 p21 = p2 - p1;

			float d1343 = dot( p13, p43 );
			float d4321 = dot( p43, p21 );
			float d1321 = dot( p13, p21 );
			float d4343 = dot( p43, p43 );
			float d2121 = dot( p21, p21 );

			float denom = d2121 * d4343 - d4321 * d4321;

			float numer = d1343 * d4321 - d1321 * d4343;

			mua = numer / denom;
			mua = clamp( mua, 0.0, 1.0 );
			mub = ( d1343 + d4321 * ( mua ) ) / d4343;
			mub = clamp( mub, 0.0, 1.0 );

			return vec2( mua, mub );

		}

		void main() {

			float alpha = opacity;
			vec4 diffuseColor = vec4( diffuse, alpha );

			#include <clipping_planes_fragment>

			#ifdef USE_DASH

				if ( vUv.y < - 1.0 || vUv.y > 1.0 ) discard; // discard endcaps

				if ( mod( vLineDistance + dashOffset, dashSize + gapSize ) > dashSize ) discard; // todo - FIX

			#endif

			#ifdef WORLD_UNITS

				float len;

				if ( isOrthographic ) {

					// View rays are parallel to the z axis so the distance reduces to camera-space XY
					vec2 lineDir = worldEnd.xy - worldStart.xy;
					float t = clamp( dot( worldPos.xy - worldStart.xy, lineDir ) / dot( lineDir, lineDir ), 0.0, 1.0 );
					len = length( worldStart.xy + lineDir * t - worldPos.xy );

				} else {

					// Find the closest points on the view ray and the line segment
					vec3 rayEnd = normalize( worldPos.xyz ) * 1e5;
					vec3 lineDir = worldEnd - worldStart;
					vec2 params = closestLineToLine( worldStart, worldEnd, vec3( 0.0, 0.0, 0.0 ), rayEnd );

					vec3 p1 = worldStart + lineDir * params.x;
					vec3 p2 = rayEnd * params.y;
					vec3 delta = p1 - p2;
					len = length( delta );

				}

				float norm = len / linewidth;

				#ifndef USE_DASH

					#ifdef USE_ALPHA_TO_COVERAGE

						float dnorm = fwidth( norm );
						alpha = 1.0 - smoothstep( 0.5 - dnorm, 0.5 + dnorm, norm );

					#else

						if ( norm > 0.5 ) {

							discard;

						}

					#endif

				#endif

			#else

				#ifdef USE_ALPHA_TO_COVERAGE

					// artifacts appear on some hardware if a derivative is taken within a conditional
					float a = vUv.x;
					float b = ( vUv.y > 0.0 ) ? vUv.y - 1.0 : vUv.y + 1.0;
					float len2 = a * a + b * b;
					float dlen = fwidth( len2 );

					if ( abs( vUv.y ) > 1.0 ) {

						alpha = 1.0 - smoothstep( 1.0 - dlen, 1.0 + dlen, len2 );

					}

				#else

					if ( abs( vUv.y ) > 1.0 ) {

						float a = vUv.x;
						float b = ( vUv.y > 0.0 ) ? vUv.y - 1.0 : vUv.y + 1.0;
						float len2 = a * a + b * b;

						if ( len2 > 1.0 ) discard;

					}

				#endif

			#endif

			#include <logdepthbuf_fragment>
			#include <color_fragment>

			gl_FragColor = vec4( diffuseColor.rgb, alpha );

			#include <tonemapping_fragment>
			#include <colorspace_fragment>
			#include <fog_fragment>
			#include <premultiplied_alpha_fragment>

		}
		`};var Z=class extends be{constructor(e){super({type:"LineMaterial",uniforms:qe.clone(ue.line.uniforms),vertexShader:ue.line.vertexShader,fragmentShader:ue.line.fragmentShader,clipping:!0}),this.isLineMaterial=!0,this.setValues(e)}get color(){return this.uniforms.diffuse.value}set color(e){this.uniforms.diffuse.value=e}get worldUnits(){return"WORLD_UNITS"in this.defines}set worldUnits(e){e===!0!==this.worldUnits&&(this.needsUpdate=!0),e===!0?this.defines.WORLD_UNITS="":delete this.defines.WORLD_UNITS}get linewidth(){return this.uniforms.linewidth.value}set linewidth(e){this.uniforms.linewidth&&(this.uniforms.linewidth.value=e)}get dashed(){return"USE_DASH"in this.defines}set dashed(e){e===!0!==this.dashed&&(this.needsUpdate=!0),e===!0?this.defines.USE_DASH="":delete this.defines.USE_DASH}get dashScale(){return this.uniforms.dashScale.value}set dashScale(e){this.uniforms.dashScale.value=e}get dashSize(){return this.uniforms.dashSize.value}set dashSize(e){this.uniforms.dashSize.value=e}get dashOffset(){return this.uniforms.dashOffset.value}set dashOffset(e){this.uniforms.dashOffset.value=e}get gapSize(){return this.uniforms.gapSize.value}set gapSize(e){this.uniforms.gapSize.value=e}get opacity(){return this.uniforms.opacity.value}set opacity(e){this.uniforms&&(this.uniforms.opacity.value=e)}get resolution(){return this.uniforms.resolution.value}set resolution(e){this.uniforms.resolution.value.copy(e)}get alphaToCoverage(){return"USE_ALPHA_TO_COVERAGE"in this.defines}set alphaToCoverage(e){this.defines&&(e===!0!==this.alphaToCoverage&&(this.needsUpdate=!0),e===!0?this.defines.USE_ALPHA_TO_COVERAGE="":delete this.defines.USE_ALPHA_TO_COVERAGE)}};var Ot=new ae,Oe=new u,ee=class extends gt{constructor(){super(),this.isLineSegmentsGeometry=!0,this.type="LineSegmentsGeometry";let e=[-1,2,0,1,2,0,-1,1,0,1,1,0,-1,0,0,1,0,0,-1,-1,0,1,-1,0],t=[-1,2,1,2,-1,1,1,1,-1,-1,1,-1,-1,-2,1,-2],n=[0,2,1,2,3,1,2,4,3,4,5,3,4,6,5,6,7,5];this.setIndex(n),this.setAttribute("position",new Ne(e,3)),this.setAttribute("uv",new Ne(t,2))}applyMatrix4(e){let t=this.attributes.instanceStart,n=this.attributes.instanceEnd;return t!==void 0&&(t.applyMatrix4(e),n.applyMatrix4(e),t.needsUpdate=!0),this.boundingBox!==null&&this.computeBoundingBox(),this.boundingSphere!==null&&this.computeBoundingSphere(),this}setPositions(e){let t;e instanceof Float32Array?t=e:Array.isArray(e)&&(t=new Float32Array(e));let n=new le(t,6,1);return this.setAttribute("instanceStart",new V(n,3,0)),this.setAttribute("instanceEnd",new V(n,3,3)),this.instanceCount=this.attributes.instanceStart.count,this.computeBoundingBox(),this.computeBoundingSphere(),this}setColors(e){let t;e instanceof Float32Array?t=e:Array.isArray(e)&&(t=new Float32Array(e));let n=new le(t,6,1);return this.setAttribute("instanceColorStart",new V(n,3,0)),this.setAttribute("instanceColorEnd",new V(n,3,3)),this}fromWireframeGeometry(e){return this.setPositions(e.attributes.position.array),this}fromEdgesGeometry(e){return this.setPositions(e.attributes.position.array),this}fromMesh(e){return this.fromWireframeGeometry(new yt(e.geometry)),this}fromLineSegments(e){let t=e.geometry;return this.setPositions(t.attributes.position.array),this}computeBoundingBox(){this.boundingBox===null&&(this.boundingBox=new ae);let e=this.attributes.instanceStart,t=this.attributes.instanceEnd;e!==void 0&&t!==void 0&&(this.boundingBox.setFromBufferAttribute(e),Ot.setFromBufferAttribute(t),this.boundingBox.union(Ot))}computeBoundingSphere(){this.boundingSphere===null&&(this.boundingSphere=new ye),this.boundingBox===null&&this.computeBoundingBox();let e=this.attributes.instanceStart,t=this.attributes.instanceEnd;if(e!==void 0&&t!==void 0){let n=this.boundingSphere.center;this.boundingBox.getCenter(n);let i=0;for(let o=0,s=e.count;o<s;o++)Oe.fromBufferAttribute(e,o),i=Math.max(i,n.distanceToSquared(Oe)),Oe.fromBufferAttribute(t,o),i=Math.max(i,n.distanceToSquared(Oe));this.boundingSphere.radius=Math.sqrt(i),isNaN(this.boundingSphere.radius)&&console.error("THREE.LineSegmentsGeometry.computeBoundingSphere(): Computed radius is NaN. The instanced position data is likely to have NaN values.",this)}}toJSON(){}};var Ye=new Y,It=new u,Wt=new u,g=new Y,v=new Y,B=new Y,Xe=new u,Qe=new me,b=new xt,Vt=new u,Ie=new ae,We=new ye,C=new Y,z,q;function Gt(r,e,t){return C.set(0,0,-e,1).applyMatrix4(r.projectionMatrix),C.multiplyScalar(1/C.w),C.x=q/t.width,C.y=q/t.height,C.applyMatrix4(r.projectionMatrixInverse),C.multiplyScalar(1/C.w),Math.abs(Math.max(C.x,C.y))}function bn(r,e){let t=r.matrixWorld,n=r.geometry,i=n.attributes.instanceStart,o=n.attributes.instanceEnd,s=Math.min(n.instanceCount,i.count);for(let a=0,l=s;a<l;a++){b.start.fromBufferAttribute(i,a),b.end.fromBufferAttribute(o,a),b.applyMatrix4(t);let c=new u,d=new u;z.distanceSqToSegment(b.start,b.end,d,c),d.distanceTo(c)<q*.5&&e.push({point:d,pointOnLine:c,distance:z.origin.distanceTo(d),object:r,face:null,faceIndex:a,uv:null,uv1:null})}}function xn(r,e,t){let n=e.projectionMatrix,o=r.material.resolution,s=r.matrixWorld,a=r.geometry,l=a.attributes.instanceStart,c=a.attributes.instanceEnd,d=Math.min(a.instanceCount,l.count),p=-e.near;z.at(1,B),B.w=1,B.applyMatrix4(e.matrixWorldInverse),B.applyMatrix4(n),B.multiplyScalar(1/B.w),B.x*=o.x/2,B.y*=o.y/2,B.z=0,Xe.copy(B),Qe.multiplyMatrices(e.matrixWorldInverse,s);for(let m=0,w=d;m<w;m++){if(g.fromBufferAttribute(l,m),v.fromBufferAttribute(c,m),g.w=1,v.w=1,g.applyMatrix4(Qe),v.applyMatrix4(Qe),g.z>p&&v.z>p)continue;if(g.z>p){let D=g.z-v.z,L=(g.z-p)/D;g.lerp(v,L)}else if(v.z>p){let D=v.z-g.z,L=(v.z-p)/D;v.lerp(g,L)}g.applyMatrix4(n),v.applyMatrix4(n),g.multiplyScalar(1/g.w),v.multiplyScalar(1/v.w),g.x*=o.x/2,g.y*=o.y/2,v.x*=o.x/2,v.y*=o.y/2,b.start.copy(g),b.start.z=0,b.end.copy(v),b.end.z=0;let ie=b.closestPointToPointParameter(Xe,!0);b.at(ie,Vt);let oe=ot.lerp(g.z,v.z,ie),he=oe>=-1&&oe<=1,Fe=Xe.distanceTo(Vt)<q*.5;if(he&&Fe){b.start.fromBufferAttribute(l,m),b.end.fromBufferAttribute(c,m),b.start.applyMatrix4(s),b.end.applyMatrix4(s);let D=new u,L=new u;z.distanceSqToSegment(b.start,b.end,L,D),t.push({point:L,pointOnLine:D,distance:z.origin.distanceTo(L),object:r,face:null,faceIndex:m,uv:null,uv1:null})}}}var Ve=class extends f{constructor(e=new ee,t=new Z({color:Math.random()*16777215})){super(e,t),this.isLineSegments2=!0,this.type="LineSegments2"}computeLineDistances(){let e=this.geometry,t=e.attributes.instanceStart,n=e.attributes.instanceEnd,i=new Float32Array(2*t.count);for(let s=0,a=0,l=t.count;s<l;s++,a+=2)It.fromBufferAttribute(t,s),Wt.fromBufferAttribute(n,s),i[a]=a===0?0:i[a-1],i[a+1]=i[a]+It.distanceTo(Wt);let o=new le(i,2,1);return e.setAttribute("instanceDistanceStart",new V(o,1,0)),e.setAttribute("instanceDistanceEnd",new V(o,1,1)),this}raycast(e,t){let n=this.material.worldUnits,i=e.camera;if(i===null&&!n&&console.error('LineSegments2: "Raycaster.camera" needs to be set in order to raycast against LineSegments2 while worldUnits is set to false.'),n===!1&&(this.material.resolution.x===0||this.material.resolution.y===0))return;let o=e.params.Line2!==void 0&&e.params.Line2.threshold||0;z=e.ray;let s=this.matrixWorld,a=this.geometry,l=this.material;q=l.linewidth+o,a.boundingSphere===null&&a.computeBoundingSphere(),We.copy(a.boundingSphere).applyMatrix4(s);let c;if(n)c=q*.5;else{let p=Math.max(i.near,We.distanceToPoint(z.origin));c=Gt(i,p,l.resolution)}if(We.radius+=c,z.intersectsSphere(We)===!1)return;a.boundingBox===null&&a.computeBoundingBox(),Ie.copy(a.boundingBox).applyMatrix4(s);let d;if(n)d=q*.5;else{let p=Math.max(i.near,Ie.distanceToPoint(z.origin));d=Gt(i,p,l.resolution)}Ie.expandByScalar(d),z.intersectsBox(Ie)!==!1&&(n?bn(this,t):xn(this,i,t))}onBeforeRender(e){let t=this.material.uniforms;t&&t.resolution&&(e.getViewport(Ye),this.material.uniforms.resolution.value.set(Ye.z,Ye.w))}};var Ft=.3,Tn=.3,Sn=1,Ge=class{group=new M;counts={entities:0,removed:0,pictures:0};frames=new Map;things=new Map;screen;constructor(){this.screen=new f(new ve(1,1),new X({side:N})),this.screen.rotation.x=Math.PI,this.screen.position.z=Tn}place(e){this.group.position.set(...e.position),this.group.quaternion.set(...e.rotation)}move(e){for(let{name:t,position:n,rotation:i}of e){let o=this.frame(t);o.children.length===0&&o.add(new St(.12)),o.position.set(...n),o.quaternion.set(...i)}}keys(){return this.things.keys()}update(e){let t=this.things.get(e.key);if(t?.removeFromParent(),t?.traverse(i=>{i instanceof f&&(i.geometry.dispose(),i.material.dispose())}),this.things.delete(e.key),e.parts.length===0){this.counts.removed++;return}let n=new M;n.add(...e.parts.map(i=>i.lines?Hn(i):Rn(i))),this.frame(e.frame).add(n),this.things.set(e.key,n),this.counts.entities++}async show({frame:e,format:t,data:n}){let i=await createImageBitmap(new Blob([n],{type:`image/${t}`}),{imageOrientation:"flipY"}),o=this.screen.material;o.map?.dispose(),o.map=new st(i),o.map.colorSpace=se,o.map.flipY=!1,o.map.needsUpdate=!0,o.needsUpdate=!0,this.screen.scale.set(Ft*i.width/i.height,Ft,1),this.frame(e).add(this.screen),this.counts.pictures++}frame(e){let t=this.frames.get(e);return t||(t=new M,this.frames.set(e,t),this.group.add(t)),t}};function Nt({colours:r}){let e=255;for(let t=3;t<r.length;t+=4)e=Math.min(e,r[t]);return e/255}function Rn(r){let e=new W;e.setAttribute("position",new T(r.positions,3)),e.setAttribute("color",new T(qt(r.colours),3,!0)),e.setIndex(new T(r.indices,1)),e.computeVertexNormals();let t=Nt(r),n=new P({vertexColors:!0,side:N,transparent:t<1,opacity:t});return new f(e,n)}function Hn(r){let e=new ee;e.setPositions(r.positions),e.setColors(Float32Array.from(qt(r.colours),i=>i/255));let t=Nt(r),n=new Z({vertexColors:!0,worldUnits:!r.pixels,linewidth:r.thickness>0?r.thickness:Sn,transparent:t<1,opacity:t,polygonOffset:!0,polygonOffsetFactor:-8,polygonOffsetUnits:-64});return new Ve(e,n)}function qt(r){let e=new Uint8Array(r.length/4*3),t=new U;for(let n=0;n<r.length/4;n++)t.setRGB(r[4*n]/255,r[4*n+1]/255,r[4*n+2]/255,se),e.set([t.r,t.g,t.b].map(i=>Math.round(255*i)),3*n);return e}var An=60,_n=.06,Jt=document.getElementById("scene"),et=Ht(),G=new Rt({canvas:Jt,antialias:!et}),Je=!1,k=!0,$t="",Kt=new Mt(G),H=new lt;H.background=new U(14673900);H.fog=new at(14673900,12,40);H.add(Ke,de,de.target);var Ln=new f(new dt(30,64),new P({color:12174022}));H.add(Ln);var Zt=new Tt(30,30,10135470,11121850);Zt.rotateX(Math.PI/2).translateY(.002);H.add(Zt);var F=new xe(62,1,.03,60),R=new Ae;R.group.add(F);H.add(R.group);var tt=new He(document.getElementById("notice"));F.add(tt.sign);var ne=new ze,S=new Pe;H.add(ne.group,S.group);var en=0,te=new Ce(Jt,R,r=>{!x||y.presenting||(en=performance.now(),rn(x,r))}),y=new Q(G,R),Ze=new Te,j=null,re=null,x=null,A=null,nt=!1,$=new _e,pe={surface:0,drawn:0},tn=0,h=new ke((r,e)=>{switch(r){case"live":return _.command({do:"live",on:e});case"flown":k=!0,x&&(x.flown=e);return;case"record":case"pause":return rt(r==="pause"===e);case"hands":return y.swap(),h.hands(y.swapped);case"enter":return void y.enter();case"undo":case"fly":case"save":case"end":return _.command({do:r})}});function rt(r){h.paused(r),_.command({do:"pause",on:r})}var Un=r=>$.sent(r),_=new Me({message:Pn,binary:Cn,sent:Un,connected:r=>h.connected(r,_.waiting),occupied:()=>h.status("another person is here: this page waits")});function Pn(r){switch(k||=r.type!=="ack"&&r.type!=="robot",r.type){case"welcome":if(r.protocol!==3)return location.reload();document.title=`PaintCopter: ${r.name}`,h.welcome(r),j??=new Re(...r.atlas),re??=new Ue(j.pictures[0]),nt||(tn=r.clock+.01-performance.now()/1e3,Yt(r.cradle,r.heading));return;case"watching":if(r.protocol!==3)return location.reload();document.title=`PaintCopter: ${r.name}`,h.watching(!0),h.paused(r.paused),A&&H.remove(A.group),A=new Ge,H.add(A.group),ne.group.visible=S.visible=!1;return;case"ack":return re?.answer(r.next_sequence),$.answered(r.next_sequence);case"place":A?.place(r),nt||Yt(r.cradle,r.heading);return;case"frames":return A?.move(r.frames);case"playback":return h.paused(r.paused),h.playback(r.elapsed);case"robot":return ne.update(r)&&(k=!0),h.robot(r);case"notice":return Bn(r.notice)}}function Yt(r,e){R.place(r,e);let t=new u(-Math.cos(e),-Math.sin(e),0);de.position.copy(t).multiplyScalar(4).add(new u(0,0,7)).addScaledVector(new u(-t.y,t.x,0),3),nt=!0}var Xt=r=>r<.01?"":`; mission.toml leaves out ${Math.round(100*r)} % of the paint, which lies too thick: less flow, or faster`;function Bn(r){let e=t=>tt.say(t,y.presenting);if(r.type==="text")return e(r.text);if(r.type==="saved")return e(`saved: ${r.path}${Xt(r.left_out)}`);if(r.type==="ended"){_.end(),h.status("ended");let t=`results in ${r.folder}${Xt(r.left_out)}`;return tt.stay(r.failed===null?t:`${t}: ${r.failed}`,y.presenting)}switch(r.say){case"move_closer":return e("Move closer to the surface");case"wait":return e("Wait: the robot is catching up");case"ready":return e("Go on");case"show_vehicle":return ne.shown=!0,e("Slower: the robot is behind");case"hide_vehicle":ne.shown=!1;return;case"queue_full":return e("The queue is full: wait for the robot")}}function Cn(r){k=!0;let e=new Uint8Array(r,0,1)[0];if(e===1&&j&&!x)x=new De(Ct(r),j),H.add(x.mesh),pe.surface=performance.now();else if(e===2){let t=Bt(r);j?.update(t),t.picture===0&&(re?.texels(),$.texels())}else e===3?A?.update(kt(r)):e===4&&A?.show(Dt(r))}function zn(r){if(r.repeat)return r.ctrlKey;switch(`${r.ctrlKey||r.metaKey?"Ctrl ":""}${r.code}`){case"KeyZ":return x&&_.command({do:"undo"}),!0;case"KeyP":return rt(!h.isPaused),!0;case"KeyR":return x&&rt(!h.isPaused),!0;case"Ctrl KeyS":return x&&_.command({do:"save"}),!0;case"Ctrl Enter":return _.command({do:"end"}),!0}return!1}addEventListener("keydown",r=>{zn(r)?r.preventDefault():!r.ctrlKey&&!r.metaKey&&R.keys.add(r.code)});addEventListener("keyup",r=>R.keys.delete(r.code));addEventListener("blur",()=>R.keys.clear());function nn(){k=!0,!y.presenting&&(G.setSize(innerWidth,innerHeight,!1),F.aspect=innerWidth/innerHeight,F.updateProjectionMatrix())}addEventListener("resize",nn);nn();function kn(r){return y.presenting?(S.visible=y.update(),S.hold(y.origin,y.direction,r),y.mode):(Ze.setFromCamera(new O(te.at.x,te.at.y),F),S.point(Ze.ray.origin,Ze.ray.direction,r,h.distance),S.visible=S.hit!==null,te.viewing||R.keys.has("KeyV")?"viewing":te.painting?"painting":"idle")}function rn(r,e){let t=kn(r);t==="painting"&&h.erasing&&(S.hit&&_.command({do:"erase",point:S.hit.point.toArray(),radius:_n}),t="idle");let n=S.pose,i={position:R.group.position.toArray(),heading:R.heading},o=JSON.stringify([t,n,i,te.pitch]);k||=o!==$t,$t=o;let s=_.state({version:1,time:tn+e/1e3,mode:t,nozzle:n,cradle:i,colour:h.colour,flow:h.flow});return t==="painting"&&S.hit&&s>=0&&($.hand(s,e),Dn(r,S.hit,s,e)),t}function Dn(r,{uv:e},t,n){let i=h.paintsFrom(S.distance);i===null||!re||(re.spray({sequence:t,time:n,uv:e,texel:r.texel,distance:i,colour:h.paint,flow:h.flow}),$.guessed(n))}var Qt=new vt;G.setAnimationLoop(r=>{Qt.update(r),R.move(Math.min(Qt.getDelta(),.1)),y.presenting||F.rotation.set(te.pitch,0,0),H.updateMatrixWorld();let e=y.presenting?performance.now():performance.now()-An;if(A&&y.presenting&&y.update(),x&&(y.presenting||e>en)&&x.project(rn(x,e)==="viewing"?ne.camera:null),re?.tidy()&&(k=!0),Je||!(k||A||y.presenting))return;k=!1,j?.upload(G),G.render(H,F);let t=G.getContext();if($.drawn(t),!y.presenting&&(et||Kt.due())){Je=et;let n=performance.now();Le(t).then(i=>{Je=!1,Kt.took(i-n)&&(k=!0)})}x&&pe.drawn===0&&(pe.drawn=-1,Le(t).then(n=>pe.drawn=n))});h.hands(y.swapped);Q.available().then(r=>h.headset(r));navigator.xr?.addEventListener("devicechange",()=>{Q.available().then(r=>h.headset(r))});Object.assign(window,{paintcopter:{connection:_,headset:y,cradle:R,camera:F,delays:$,first:pe,renderer:G,atlas:()=>j,wall:()=>x,watch:()=>A}});
